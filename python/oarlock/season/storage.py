"""Where a season lies: `SeasonStorage`, and `FolderStorage` for a disk or a share.

Writes are seen by readers as a whole or not at all. Names are relative, with `/` between their parts.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import UnreadableFileError, read_bytes
from oarlock.storage.write_file import sync, sync_folder, unwritable, write_file

OWN_WORK = ".new"
"""Folder, in that of an athlete, in which folders are written before their rename."""
_ATTEMPTS = 50


class SeasonStorage(Protocol):
    """What a season needs of its storage."""

    address: str

    def read(self, name: str) -> bytes:
        """The contents; a FileNotFoundError if nothing has this name."""

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

    def put_folder(self, folder: str, files: Mapping[str, bytes], record: str) -> bool:
        """Write a new folder of which readers see everything once its commit record is there, and nothing before.

        Returns:
            Whether it was written; False if the folder was there with its record.
        """

    def remove(self, names: Sequence[str]) -> None:
        """Remove files; one that is gone already is no error."""

    def remove_folder(self, folder: str, record: str = "") -> None:
        """Remove a folder with all that is in it, its commit record first."""

    def remove_empty(self, folder: str) -> None:
        """Remove a folder, and those in it, as far as there are no files in them; an object store has none."""

    def on_disk(self, name: str) -> Path:
        """A file of the same contents that other programs can open, itself or a copy; errors as `read`."""

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """Remove the copies that `on_disk` made, but not in these folders; returns how many were removed."""


def checked_name(name: str) -> str:
    """The name, if it leads to no other place."""
    parts = name.split("/")
    if name.startswith("/") or "\\" in name or any(part in ("", ".", "..") for part in parts):
        raise DataError(f"{name!r}: is no name inside a season")
    return name


class FolderStorage:
    """The season of one folder: a folder is written beside and renamed."""

    def __init__(self, root: Path) -> None:
        self.root = root.absolute()
        self.address = str(root)

    def read(self, name: str) -> bytes:
        """As `SeasonStorage.read`."""
        try:
            return read_bytes(self._at(name))
        except UnreadableFileError as error:
            if isinstance(error.__cause__, FileNotFoundError | NotADirectoryError):
                raise FileNotFoundError(name) from error
            raise

    def write(self, name: str, contents: bytes) -> None:
        """As `SeasonStorage.write`."""
        write_file(self._at(name), contents)

    def exists(self, name: str) -> bool:
        """As `SeasonStorage.exists`."""
        return self._at(name).is_file()

    def children(self, folder: str) -> list[str]:
        """As `SeasonStorage.children`."""
        try:
            return sorted(entry.name for entry in os.scandir(self._at(folder) if folder else self.root))
        except FileNotFoundError:
            return []

    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """As `SeasonStorage.files`."""
        for place, folders, names in os.walk(self._at(folder) if folder else self.root):
            folders.sort()
            for name in sorted(names):
                file = Path(place, name)
                with suppress(FileNotFoundError):  # gone meanwhile
                    yield file.relative_to(self.root).as_posix(), file.lstat().st_size

    def age_s(self, name: str) -> float:
        """As `SeasonStorage.age_s`."""
        try:
            return max(0.0, time.time() - self._at(name).stat().st_mtime)
        except FileNotFoundError:
            return 0.0

    def put_folder(self, folder: str, files: Mapping[str, bytes], record: str) -> bool:
        """As `SeasonStorage.put_folder`; the rename is the commit."""
        target = self._at(folder)
        if (target / record).is_file():
            return False
        stage = self.root / folder.partition("/")[0] / OWN_WORK / secrets.token_hex(12)
        try:
            stage.mkdir(parents=True)
            for name, contents in files.items():
                file = stage / checked_name(name)
                file.parent.mkdir(parents=True, exist_ok=True)
                with file.open("xb") as stream:
                    stream.write(contents)
                    stream.flush()
                    sync(stream.fileno())
            sync_folder(stage)
            return self._commit(stage, target, record)
        except OSError as error:
            raise unwritable(target, error) from error
        finally:
            shutil.rmtree(stage, ignore_errors=True)

    def _commit(self, stage: Path, target: Path, record: str) -> bool:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.rename(stage, target)
        except OSError:
            if (target / record).is_file():
                return False  # another writer was first
            if not target.is_dir():
                raise
            # What is left of a folder of which the removal was interrupted.
            shutil.rmtree(target)
            os.rename(stage, target)
        sync_folder(target.parent)
        return True

    def remove(self, names: Sequence[str]) -> None:
        """As `SeasonStorage.remove`."""
        for name in names:
            self._at(name).unlink(missing_ok=True)

    def remove_folder(self, folder: str, record: str = "") -> None:
        """As `SeasonStorage.remove_folder`."""
        target = self._at(folder)
        if record:
            (target / record).unlink(missing_ok=True)
        for attempt in range(_ATTEMPTS):
            try:
                return shutil.rmtree(target)
            except OSError as error:  # another process removes it too, or still writes into it
                if not target.exists():
                    return None
                is_shared = isinstance(error, FileNotFoundError | FileExistsError)
                if attempt == _ATTEMPTS - 1 or not (is_shared or error.errno == errno.ENOTEMPTY):
                    raise unwritable(target, error) from error

    def remove_empty(self, folder: str) -> None:
        """As `SeasonStorage.remove_empty`."""
        for place, _, _ in os.walk(self._at(folder), topdown=False):
            with suppress(OSError):
                os.rmdir(place)

    def on_disk(self, name: str) -> Path:
        """As `SeasonStorage.on_disk`: the file itself."""
        if not self.exists(name):
            raise FileNotFoundError(name)
        return self._at(name)

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """As `SeasonStorage.forget_copies`: none are made."""
        return 0

    def _at(self, name: str) -> Path:
        return self.root / checked_name(name)
