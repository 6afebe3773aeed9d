"""Recordings and calibrations: streams of readings, plausibility checks, corrections, and the files of both."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
