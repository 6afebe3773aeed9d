"""The public names of `oarlock.live` and the modules that define them."""

from .channel_tables import Channel, channels
from .client import frames

__all__ = ["Channel", "channels", "frames"]
