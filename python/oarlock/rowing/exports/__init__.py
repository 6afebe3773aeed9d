"""Reads strokes from exports of other devices: Quiske, RP3, NK, and common ergometer logs."""
