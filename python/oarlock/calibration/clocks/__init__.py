"""Streams with clocks of their own: their offsets and drifts, from the movement that all of them see."""
