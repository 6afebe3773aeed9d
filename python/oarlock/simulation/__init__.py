"""Simulates recordings: joint trajectories, sensor signals along them, and guided calibration sessions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
