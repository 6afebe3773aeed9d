"""The public names of `oarlock.live` and the modules that define them."""

from .client import events, frames

__all__ = ["events", "frames"]
