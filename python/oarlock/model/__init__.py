"""Models of bodies: model files and their loading, coordinates, rotations, shapes of the figure."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
