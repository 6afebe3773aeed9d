"""Models of bodies: model files and their loading, coordinates, rotations, shapes of the figure."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
