"""Tracks recordings and smooths tracks. Contains `track`, `smooth`, `track_many`, the class `Track` and its files."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
