"""Simulates recordings: joint trajectories, sensor signals along them, and guided calibration sessions."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
