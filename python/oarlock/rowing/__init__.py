"""Rowing, built on the public interface: strokes, technique, reports, simulation of sculling, sweep and ergometer."""

from oarlock.storage.extras import public_names

# A name loads its module when it is first used: most programs need few of them.
__getattr__, __dir__, __all__ = public_names(__name__, __file__)
