"""One writer at a time in a folder. The lock ends with its process, also if that is killed."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from oarlock.storage.errors import DataError

WORK = ".oarlock"
"""Folder inside an output folder while it is written: the lock, the new files, the files on their way."""

OPEN_FILES_STAY = os.name == "nt"
"""Whether the system refuses to remove a file that is open."""

TREE = "tree"
"""Folder inside `.oarlock/new` and `.oarlock/commit` with the new files."""


def is_staged(folder: Path) -> bool:
    """Whether the folder lies among the new files of a writer, which syncs them all before it moves them."""
    parts = folder.absolute().parts
    return any(parts[k : k + 3] == (WORK, "new", TREE) for k in range(len(parts) - 2))


class FolderLock:
    """The lock of one folder.

    Raises:
        DataError: another process writes into the folder, or `.oarlock` in it is not a folder of ours.
    """

    def __init__(self, folder: Path) -> None:
        self.work = folder / WORK
        self._file = self.work / "lock"
        self._number = self._taken(folder)

    def _taken(self, folder: Path) -> int:
        while True:
            if self.work.is_symlink():
                raise DataError(f"{self.work}: is a link; remove it, then run the command again")
            try:
                self.work.mkdir(exist_ok=True)
                number = os.open(self._file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
            except FileNotFoundError:  # the writer before us is just removing it
                continue
            except FileExistsError:
                if self.work.is_dir() or not self.work.exists():
                    continue  # as above
                raise DataError(f"{self.work}: is a file; remove it, then run the command again") from None
            try:
                if self._is_owned(folder, number):
                    return number
            except BaseException:
                os.close(number)
                raise
            os.close(number)

    def _is_owned(self, folder: Path, number: int) -> bool:
        """Locks the open file; false if the writer before has removed it in the meantime."""
        if not _locked(number):
            who = os.pread(number, 20, 0).decode(errors="replace").strip() if hasattr(os, "pread") else ""
            raise DataError(
                f"{folder}: another run{f' (process {who})' if who else ''} is writing into this folder. "
                "Wait for its end, or choose another folder."
            )
        if not self._is_current(number):
            return False
        os.truncate(number, 0)
        os.write(number, f"{os.getpid()}\n".encode())
        return True

    def _is_current(self, number: int) -> bool:
        """Whether the file that was locked still stands there: the writer before may have removed it."""
        try:
            return os.path.samestat(os.fstat(number), os.stat(self._file))
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Remove the folder `.oarlock` unless files on their way are in it, and end the lock."""
        if OPEN_FILES_STAY:  # there a file that the next writer has opened stays too
            os.close(self._number)
        with suppress(OSError):
            self._file.unlink(missing_ok=True)
            self.work.rmdir()
        if not OPEN_FILES_STAY:
            os.close(self._number)


if sys.platform == "win32":
    import msvcrt

    def _locked(number: int) -> bool:
        try:
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _locked(number: int) -> bool:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
