"""Searches that produce a `Calibration`: from a static pose or single joints, a guided session, clocks, or movement."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
