"""Rowing, built on the public interface: strokes, technique, reports, simulation of sculling, sweep and ergometer."""

import lazy_loader

# A name loads its module when it is first used: most programs need few of them.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
