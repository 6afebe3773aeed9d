"""Converts paths that users give to `Path`, with checks; names Oarlock's own places."""

import errno
import os
from os import PathLike
from pathlib import Path

from oarlock.storage.errors import DataError

AnyPath = str | PathLike[str]
STAGED, COMMIT = Path(".oarlock/new"), Path(".oarlock/commit")
"""In a folder that is written: its new files, and complete ones that are moved to their places."""


def place_of(path: AnyPath) -> Path:
    """The path as a `Path`; it need not exist.

    Raises:
        DataError: The name is too long, or contains a null character.
    """
    place = Path(path)
    try:
        place.stat()
    except ValueError:
        raise DataError(f"{str(path)!r}: is not a valid file name; it contains a null character") from None
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise DataError(f"{place.name[:60]}...: is not a valid file name; it is too long") from None
    return place


def state_folder() -> Path:
    """`oarlock` in `XDG_STATE_HOME`, `LOCALAPPDATA`, or `~/.local/state`; it may not exist."""
    base = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".local/state"
    return Path(base, "oarlock")
