"""Where a season lies: a folder or an object store, with writes that a reader sees as a whole or not at all.

Names are relative, with `/` between their parts, such as `results/0f3a.91cc/run.toml`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from oarlock.storage.errors import DataError

OWN_WORK = ".new"
"""Folder of a season on a disk in which folders are written before their rename."""


class SeasonStorage(Protocol):
    """What a season needs of its storage."""

    address: str

    def read(self, name: str) -> bytes:
        """The contents.

        Raises:
            FileNotFoundError: nothing has this name.
        """

    def write(self, name: str, contents: bytes) -> None:
        """Write or replace one file as a whole."""

    def exists(self, name: str) -> bool:
        """Whether a file has this name."""

    def children(self, folder: str) -> list[str]:
        """Names of the files and folders in a folder, sorted; empty if it does not exist."""

    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """Name and size in bytes of every file below a folder, those of unfinished writes too."""

    def age_s(self, name: str) -> float:
        """Seconds since a file was last written; 0 if it is gone."""

    def put_folder(self, folder: str, files: Mapping[str, bytes | Path], record: str) -> bool:
        """Write a new folder of which readers see everything once its commit record is there, and nothing before.

        Args:
            folder: the new folder.
            files: contents, or the file that has them, by name inside the folder.
            record: name of the commit record among them.

        Returns:
            Whether it was written; False if the folder was there with its record.
        """

    def remove(self, names: Sequence[str]) -> None:
        """Remove files; one that is gone already is no error."""

    def remove_folder(self, folder: str, record: str = "") -> None:
        """Remove a folder with all that is in it, its commit record first."""

    def on_disk(self, names: Sequence[str]) -> list[Path]:
        """Files of the same contents that other programs can open: these, or copies in the cache."""

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """Remove the copies that `on_disk` has made, but not of these files; returns how many were removed."""


def checked_name(name: str) -> str:
    """The name, if it leads to no other place.

    Raises:
        DataError: it leads out of the season.
    """
    parts = name.split("/")
    if name.startswith("/") or "\\" in name or any(part in ("", ".", "..") for part in parts):
        raise DataError(f"{name!r}: is no name inside a season")
    return name
