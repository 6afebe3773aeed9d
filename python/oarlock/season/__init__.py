"""A squad's season: stores recordings and results once, computes them again after changes, answers questions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
