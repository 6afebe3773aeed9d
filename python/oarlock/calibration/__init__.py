"""Searches that produce a `Calibration`: from a static pose or single joints, a guided session, clocks, or movement."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
