"""Sends estimates, events and repetitions of a live session to other programs: JSON lines and OSC by UDP, and LSL."""
