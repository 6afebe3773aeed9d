"""Streams with clocks of their own: their offsets and drifts, from the movement that all of them see."""

from oarlock.clocks.calibrate import calibrate_clocks

__all__ = ["calibrate_clocks"]
