"""The public names of `oarlock.live` and the modules that define them."""

from .channel_tables import Channel, channels
from .client import events, frames

__all__ = ["Channel", "channels", "events", "frames"]
