"""Evaluates tracks: scores against ground truth and markers, comparisons, Monte-Carlo studies, sensor faults."""

from oarlock.storage.extras import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
