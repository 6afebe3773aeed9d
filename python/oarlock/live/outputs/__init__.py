"""Sends estimates, strokes and events of a live session to other programs: JSON lines and OSC by UDP, and LSL."""
