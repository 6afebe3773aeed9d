"""Replaces one file as a whole: what a reader finds is the old file or the new one, whenever the writer ends."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.names import check_text
from oarlock.storage.paths import COMMIT, STAGED

TEMPORARY = ".oarlock-"
_ELSEWHERE = " Choose a folder that you may write into."


def is_staged(folder: Path) -> bool:
    """Whether the folder lies among the new files of a folder, which are synced together before they are moved."""
    return f"/{STAGED.as_posix()}/" in f"{folder.absolute().as_posix()}/"


def write_file(file: Path, contents: str | bytes) -> None:
    """Write a new file beside `file`, sync it to the disk and rename it. A link is replaced, not followed.

    Args:
        file: the file; it is replaced if it exists. Its folder is made if it does not exist.
        contents: bytes, or text that is written as UTF-8 without changes to its line ends.

    Raises:
        DataError: the text contains half a character, the file cannot be written, or it is a folder or a device.
    """
    if isinstance(contents, str):
        check_text(contents, str(file))
        contents = contents.encode("utf-8")
    check_replaceable(file)
    if is_staged(file.parent):
        file.write_bytes(contents)
        return
    temporary = file.with_name(f"{TEMPORARY}{secrets.token_hex(8)}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as stream:
            stream.write(contents)
            stream.flush()
            sync(stream.fileno())
        os.replace(temporary, file)
        sync_path(file.parent)
    except BaseException as error:
        with suppress(OSError):  # on a read-only disk even this fails
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise unwritable(file, error) from error
        raise


def check_replaceable(file: Path) -> None:
    """Refuse a target that is a folder or a device, such as /dev/null.

    Raises:
        DataError: it is.
    """
    try:
        mode = file.lstat().st_mode
    except (OSError, ValueError):
        return
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        what = "a folder" if stat.S_ISDIR(mode) else "a device or a pipe"
        raise DataError(f"{file}: is {what}, so it cannot be replaced by a file; choose another name")


def check_empty(folder: Path, force: bool = False, beside: str = "") -> None:
    """Refuse a folder that contains files, but for `beside`: nothing is replaced without `force`.

    Raises:
        DataError: it contains files, and `force` is not set; or it is a file.
    """
    if not os.path.lexists(folder):
        return
    if not folder.is_dir():
        raise DataError(f"{folder} is a file; --out (out) names a folder")
    # What a run that was killed has left does not count, unless it is complete.
    files = (*folder.iterdir(), *folder.glob(str(COMMIT)))
    if not force and any(file.name not in (STAGED.parts[0], beside) for file in files):
        raise DataError(
            f"{folder} exists and contains files\n"
            "Choose another folder, or replace what Oarlock wrote there with --force (force=True)."
        )


def check_writable(folder: Path) -> None:
    """Refuse a folder into which nothing can be written, before the work of which the result shall be there.

    Folders that are missing on the way to it count as writable if they can be made.

    Raises:
        DataError: it is a file, or it cannot be written or made.
    """
    place = folder.absolute()
    while not os.path.lexists(place):
        place = place.parent
    if not place.is_dir():
        raise DataError(f"{place}: is not a folder, so nothing can be written into it; choose another place")
    if not os.access(place, os.W_OK | os.X_OK):
        raise unwritable(folder, OSError(errno.EACCES, "no permission, or a read-only disk"))


def sync(number: int) -> None:
    """Make what an open file contains last through a loss of power; `fsync` of macOS leaves it in the drive's cache."""
    try:
        from fcntl import F_FULLFSYNC, fcntl  # type: ignore[attr-defined,unused-ignore]

        fcntl(number, F_FULLFSYNC)
    except (ImportError, OSError):  # another system, or a disk that does not know it, as in the network
        os.fsync(number)


def sync_path(path: Path) -> None:
    """Make a file, or the names in a folder, last through a loss of power, where the system can do it."""
    is_folder = path.is_dir()
    if is_folder and os.name == "nt":
        return
    number = os.open(path, os.O_RDONLY if is_folder else os.O_RDWR)
    try:
        sync(number)
    except OSError as error:
        if not is_folder or error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EROFS):
            raise
    finally:
        os.close(number)


def unwritable(place: Path, error: OSError) -> DataError:
    """The error of a file or folder that the system does not let us write; it says what can be done."""
    advice = {
        errno.ENOSPC: " Free some space, or choose a folder on another disk; what was there before is unchanged.",
        errno.EFBIG: " The file would exceed the limit on file sizes (ulimit -f); what was there is unchanged.",
        errno.EDQUOT: " Your quota is used up; what was there before is unchanged.",
        errno.EROFS: _ELSEWHERE,
        errno.EACCES: _ELSEWHERE,
        errno.EPERM: _ELSEWHERE,
    }.get(error.errno or 0, "")
    return DataError(f"{place}: cannot be written ({error.strerror or error}).{advice}")
