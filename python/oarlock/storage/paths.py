"""Converts paths that users give to `Path`, with checks."""

import errno
from os import PathLike
from pathlib import Path

from oarlock.storage.errors import DataError


def place_of(path: str | PathLike[str]) -> Path:
    """The path, whether or not something is there.

    Raises:
        DataError: No file can have this name: it is too long, or holds a zero character.
    """
    place = Path(path)
    try:
        place.stat()
    except ValueError:
        raise DataError(f"{str(path)!r}: no file can have this name; it holds a zero character") from None
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise DataError(f"{place.name[:60]}...: no file can have this name; it is too long") from None
    return place
