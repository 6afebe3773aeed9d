"""A season in a folder, on this disk or on a share: a folder is written beside and renamed."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from oarlock.season.place import OWN_WORK, checked_name
from oarlock.storage.regular_file import UnreadableFileError, open_regular, read_bytes
from oarlock.storage.write_file import sync, sync_folder, unwritable, write_file

_ATTEMPTS = 50


class FolderStorage:
    """The season of one folder."""

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
        top = self._at(folder) if folder else self.root
        for place, folders, names in os.walk(top):
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

    def put_folder(self, folder: str, files: Mapping[str, bytes | Path], record: str) -> bool:
        """As `SeasonStorage.put_folder`; the rename is the commit."""
        target = self._at(folder)
        if (target / record).is_file():
            return False
        stage = self.root / OWN_WORK / secrets.token_hex(12)
        try:
            self._fill(stage, files)
            return self._commit(stage, target, record)
        except OSError as error:
            raise unwritable(target, error) from error
        finally:
            shutil.rmtree(stage, ignore_errors=True)

    def _fill(self, stage: Path, files: Mapping[str, bytes | Path]) -> None:
        stage.mkdir(parents=True)
        for name, contents in files.items():
            file = stage / checked_name(name)
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("xb") as stream:
                if isinstance(contents, Path):
                    with open_regular(contents) as source:
                        shutil.copyfileobj(source, stream)
                else:
                    stream.write(contents)
                stream.flush()
                sync(stream.fileno())
        sync_folder(stage)

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
                shutil.rmtree(target)
            except OSError as error:  # another process removes it too, or still writes into it
                if not target.exists():
                    return
                last = attempt == _ATTEMPTS - 1
                if last or (
                    not isinstance(error, FileNotFoundError | FileExistsError)
                    and error.errno != errno.ENOTEMPTY
                ):
                    raise unwritable(target, error) from error
            else:
                return

    def on_disk(self, names: Sequence[str]) -> list[Path]:
        """As `SeasonStorage.on_disk`: the files themselves."""
        return [self._at(name) for name in names]

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """As `SeasonStorage.forget_copies`: none are made."""
        return 0

    def _at(self, name: str) -> Path:
        return self.root / checked_name(name)
