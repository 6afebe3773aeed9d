"""A squad's season: stores recordings and results once, computes them again after changes, answers questions."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
