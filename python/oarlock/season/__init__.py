"""A squad's season: recordings and results stored once, asked anything, computed again where something changed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
