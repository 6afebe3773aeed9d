"""Evaluates tracks: scores against ground truth and markers, comparisons, Monte-Carlo studies, sensor faults."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
