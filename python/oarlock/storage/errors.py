"""The exceptions of the package, defined by the engine."""

from oarlock._core import DataError, DivergedError, ModelError

__all__ = ["DataError", "DivergedError", "ModelError"]
