"""The public names of `oarlock.live` and the modules that define them."""

from .client import frames

__all__ = ["frames"]
