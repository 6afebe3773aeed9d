"""Where a season lies: `SeasonStorage`, and `FolderStorage` for a disk or a share.

Names are relative, with `/` between their parts. A folder counts from the moment at which its commit record is there.
"""

from __future__ import annotations

import os
import time
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import UnreadableFileError, read_bytes
from oarlock.storage.write_file import sync_path, unwritable, write_file

_OTHER_WRITER_S = 30.0
"""Files without a commit record that are older are of a writer that was stopped, and are written over."""
_POLL_S = 0.2


class SeasonStorage(ABC):
    """What a season needs of its storage.

    Attributes:
        address: a path, or such as `s3://club/season`.
    """

    address: str

    @abstractmethod
    def read(self, name: str) -> bytes:
        """The contents; a FileNotFoundError if nothing has this name."""

    @abstractmethod
    def write(self, name: str, contents: bytes) -> None:
        """Write or replace one file; readers see the old contents or the new ones."""

    @abstractmethod
    def create(self, name: str, contents: bytes) -> bool:
        """Write a file if there is none; False if there is one."""

    @abstractmethod
    def children(self, folder: str) -> list[str]:
        """Names of the files and folders in a folder, sorted; empty if it does not exist."""

    @abstractmethod
    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """Name and size in bytes of every file below a folder, those of unfinished writes too."""

    @abstractmethod
    def age_s(self, name: str) -> float | None:
        """Seconds since a file was last written; None if there is none."""

    @abstractmethod
    def remove(self, names: Sequence[str]) -> None:
        """Remove files; one that is gone already is no error."""

    @abstractmethod
    def on_disk(self, name: str) -> Path:
        """A file of the same contents that other programs can open, itself or a copy; errors as `read`."""

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """Remove the copies that `on_disk` made, but not in these folders; returns how many were removed."""
        return 0

    def exists(self, name: str) -> bool:
        """Whether a file has this name."""
        return self.age_s(name) is not None

    def put_folder(self, folder: str, files: Mapping[str, bytes], record: str) -> bool:
        """Write a new folder, its commit record last: before, it counts as unfinished.

        Writers of one folder begin with the same file, so of two whose contents differ one creates the first file
        that differs, and the other one waits for its commit record. If none comes, that writer was stopped, and its
        files are written over.

        Returns:
            Whether it was written; False if the folder was there with its record.
        """
        if self.exists(f"{folder}/{record}"):
            return False
        for name in sorted(files.keys() - {record}):
            full, contents = f"{folder}/{name}", files[name]
            if self.create(full, contents) or self._is(full, contents):
                continue
            if self._is_committed(folder, record, full):
                return False
            self.write(full, contents)
        self.write(f"{folder}/{record}", files[record])
        return True

    def _is(self, name: str, contents: bytes) -> bool:
        with suppress(FileNotFoundError):
            return self.read(name) == contents
        return False

    def _is_committed(self, folder: str, record: str, name: str) -> bool:
        """Whether the writer of a file commits, or has stopped."""
        while not self.exists(f"{folder}/{record}"):
            age_s = self.age_s(name)
            if age_s is None or age_s > _OTHER_WRITER_S:
                return False
            time.sleep(_POLL_S)
        return True

    def remove_folder(self, folder: str, record: str = "") -> None:
        """Remove a folder with all that is in it, its commit record first."""
        if record:
            self.remove([f"{folder}/{record}"])
        self.remove([name for name, _ in self.files(f"{folder}/")])
        self.remove_empty(folder)

    def remove_empty(self, folder: str) -> None:
        """Remove a folder, and those in it, as far as there are no files in them; an object store has none."""
        return None


def checked_name(name: str) -> str:
    """The name, if it leads to no other place."""
    if name.startswith("/") or "\\" in name or {"", ".", ".."} & set(name.split("/")):
        raise DataError(f"{name!r}: is no name inside a season")
    return name


class FolderStorage(SeasonStorage):
    """The season of one folder."""

    def __init__(self, root: Path) -> None:
        self.root, self.address = root.absolute(), str(root)

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

    def create(self, name: str, contents: bytes) -> bool:
        """As `SeasonStorage.create`."""
        file = self._at(name)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("xb") as stream:
                stream.write(contents)
            sync_path(file)
            sync_path(file.parent)
        except FileExistsError:
            return False
        except BaseException as error:
            with suppress(OSError):
                file.unlink()
            if isinstance(error, OSError):
                raise unwritable(file, error) from error
            raise
        return True

    def children(self, folder: str) -> list[str]:
        """As `SeasonStorage.children`."""
        with suppress(FileNotFoundError):
            return sorted(os.listdir(self._at(folder)))
        return []

    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """As `SeasonStorage.files`."""
        for place, folders, names in os.walk(self._at(folder)):
            folders.sort()
            for name in sorted(names):
                file = Path(place, name)
                with suppress(FileNotFoundError):  # gone meanwhile
                    yield file.relative_to(self.root).as_posix(), file.lstat().st_size

    def age_s(self, name: str) -> float | None:
        """As `SeasonStorage.age_s`."""
        with suppress(FileNotFoundError, NotADirectoryError):
            return max(0.0, time.time() - self._at(name).stat().st_mtime)
        return None

    def remove(self, names: Sequence[str]) -> None:
        """As `SeasonStorage.remove`."""
        for name in names:
            self._at(name).unlink(missing_ok=True)

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

    def _at(self, name: str) -> Path:
        return self.root / checked_name(name.rstrip("/")) if name else self.root
