"""The exceptions of the package, as the engine defines them."""

from oarlock._core import DataError, DivergedError, ModelError

__all__ = ["DataError", "DivergedError", "ModelError"]
