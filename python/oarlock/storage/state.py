"""Where this program keeps what must outlive the folders of a user."""

import os
from pathlib import Path


def state_folder() -> Path:
    """`oarlock` in `XDG_STATE_HOME`, `LOCALAPPDATA`, or `~/.local/state`; it may not exist."""
    base = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".local/state"
    return Path(base, "oarlock")
