"""Tracks recordings and smooths tracks. Contains `track`, `smooth`, `track_many`, the class `Track` and its files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
