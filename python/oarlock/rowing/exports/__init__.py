"""Strokes from other devices' exports: Quiske, RP3, NK, and the usual logs of ergometers."""
