"""`open_place`: from an address to where a season lies."""

from __future__ import annotations

from pathlib import Path

from oarlock.season.disk import FolderStorage
from oarlock.season.objects import open_objects
from oarlock.season.place import SeasonStorage


def open_place(address: str) -> SeasonStorage:
    """The place of an address: a path, or an address of an object store, such as `s3://bucket/season`.

    Raises:
        DataError: the address has a scheme that nothing here can open.
    """
    if "://" not in address:
        return FolderStorage(Path(address))
    if address.startswith("file://"):
        return open_place(address.removeprefix("file://"))
    return open_objects(address)
