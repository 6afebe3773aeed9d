"""Replaces what Oarlock wrote in a folder as a whole; all savers of folders use it.

New files are written into `.oarlock/new/tree` inside the folder, checked, hashed and synced to the disk. The rename of
`.oarlock/new` to `.oarlock/commit` is the instant at which the folder has its new contents: from then on they are only
moved to their places, by this process or, if it was killed, by the next reader or writer.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from oarlock.storage.errors import DataError
from oarlock.storage.folder_lock import TREE, WORK, FolderLock, is_staged
from oarlock.storage.manifest import MANIFEST, SESSION_FILE, Manifest, sha256_of
from oarlock.storage.regular_file import read_text
from oarlock.storage.write_file import check_replaceable, sync_file, sync_folder, unwritable, write_file

_GONE = "gone.json"
_DISK = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EROFS)


class FolderWriter:
    """A folder that is being written. Write into `stage`, then `commit`; `abandon` leaves all as it was.

    Args:
        folder: the folder; it is made if it does not exist.
        kind: what it will hold, for the manifest.
        force: replace files of others, too.

    Raises:
        DataError: another process writes into it, or it cannot be written.
    """

    def __init__(self, folder: Path, kind: str, force: bool = False) -> None:
        self.folder, self._kind, self._force = folder, kind, force
        self._is_new = not folder.exists()
        self._lock: FolderLock | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(folder)
            _finish(folder)
            self._new = self._lock.work / "new"
            _remove(self._new)
            self.stage = self._new / TREE
            self.stage.mkdir(parents=True)
        except BaseException as error:
            self.abandon()
            if isinstance(error, OSError):
                raise unwritable(folder, error) from error
            raise

    def commit(self) -> None:
        """Give the folder its new contents: the files in `stage`, in place of those of the same kind before.

        Raises:
            DataError: a file of somebody else is in the way, or the disk is full; nothing has changed then.
        """
        self._commit(keeps_others=False)

    def commit_beside(self) -> None:
        """Add the files in `stage` to those that are there. Raises as `commit`."""
        self._commit(keeps_others=True)

    def abandon(self) -> None:
        """Remove what was staged; a folder that this writer made is removed, too. Does nothing after `commit`."""
        if self._lock is None:
            return
        _remove(self._lock.work / "new")
        self._lock.release()
        self._lock = None
        if self._is_new:
            _remove_if_empty(self.folder)

    def _commit(self, keeps_others: bool) -> None:
        assert self._lock is not None
        try:
            before = (Manifest.read(self.folder) or Manifest(self.folder)).with_nested()
            staged = _files_under(self.stage)
            listed = before.kinds.get(self._kind, {})
            ours = [*listed, *([SESSION_FILE] if listed else [])]
            gone = [] if keeps_others else [name for name in ours if name not in staged]
            self._check_free(before, [*staged, *gone])
            files = _hashed(self.stage)
            after = before.with_files(self._kind, {**listed, **files} if keeps_others else files)
            write_file(self.stage / MANIFEST, after.text())
            (self._new / _GONE).write_text(json.dumps(gone), encoding="utf-8")
            _sync_tree(self._new)
            os.rename(self._new, self._lock.work / "commit")
        except OSError as error:
            self.abandon()
            raise unwritable(self.folder, error) from error
        except BaseException:
            self.abandon()
            raise
        try:
            sync_folder(self._lock.work)
            _finish(self.folder)
        except OSError as error:
            raise _unmoved(self.folder, error) from error
        finally:
            self.abandon()

    def _check_free(self, before: Manifest, names: list[str]) -> None:
        """Refuse to replace what is not ours. A manifest of somebody else has failed to be read before."""
        check_replaceable(self.folder / MANIFEST)
        for name in (name for name in names if name != MANIFEST and Path(name).name != SESSION_FILE):
            file = _inside(self.folder, name)
            if os.path.lexists(file):
                check_replaceable(file)
                if not (self._force or before.is_unchanged(name)):
                    raise DataError(
                        f"{file}: was not written by Oarlock, or was changed since. Choose another folder, move the "
                        "file away, or replace it with --force (force=True)."
                    )


@contextmanager
def replaced_folder(folder: str | PathLike[str], kind: str, force: bool = False) -> Iterator[Path]:
    """Context that gives the folder to write into; at its end the files are in `folder`, in place of ours before.

    Inside of another such context it is the folder itself: then the outer one moves its files.

    Args:
        folder: the folder to replace.
        kind: what it will hold: "recording", "track", ...
        force: replace files of others, too.

    Raises:
        DataError: another process writes into the folder, a file of somebody else is in the way, or the disk is full.
            The folder is unchanged then.
    """
    place = Path(folder)
    if is_staged(place):
        place.mkdir(parents=True, exist_ok=True)
        yield place
        write_file(place / MANIFEST, Manifest(place).with_files(kind, _hashed(place)).text())
        return
    writer = FolderWriter(place, kind, force)
    try:
        yield writer.stage
        writer.commit()
    except OSError as error:
        if error.errno in _DISK or WORK in Path(str(error.filename)).parts:
            raise unwritable(place, error) from error
        raise
    finally:
        writer.abandon()


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Context that gives a temporary folder, in which nothing is synced to the disk: its files are read and gone."""
    with TemporaryDirectory() as scratch:
        folder = Path(scratch, WORK, "new", TREE)
        folder.mkdir(parents=True)
        yield folder


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a folder that is about to be read, after an interrupted move of its files is finished.

    Raises:
        DataError: the files of an interrupted run cannot be moved to their places, or the manifest is damaged.
    """
    if (folder / WORK / "commit").is_dir():
        try:
            lock = FolderLock(folder)
            try:
                _finish(folder)
            finally:
                lock.release()
        except OSError as error:
            raise _unmoved(folder, error) from error
    return Manifest.read(folder)


def check_files(manifest: Manifest | None, names: list[str]) -> None:
    """Compare files that were read with the manifest that was read before them; without a manifest all pass."""
    if manifest is not None:
        manifest.check(names)


def _hashed(folder: Path) -> dict[str, str]:
    names = (n for n in _files_under(folder) if n != MANIFEST and Path(n).name != SESSION_FILE)
    return {name: sha256_of(folder / name) for name in names}


def _files_under(folder: Path) -> list[str]:
    """Paths of all files in a folder and its folders, with `/`, in order."""
    return sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if not file.is_dir())


def _finish(folder: Path) -> None:
    """Move the files of a commit to their places; it may have been begun by a process that was killed."""
    commit = folder / WORK / "commit"
    tree = commit / TREE
    if not commit.is_dir():
        return
    if commit.is_symlink() or tree.is_symlink():
        raise DataError(f"{commit}: is a link; remove it")
    touched = {folder}
    for name in _names_gone(commit / _GONE):
        file = _inside(folder, name)
        file.unlink(missing_ok=True)
        if file.parent != folder:
            _remove_if_empty(file.parent)
    for name in _files_under(tree):
        place = _inside(folder, name)
        place.parent.mkdir(parents=True, exist_ok=True)
        os.replace(tree / name, place)
        touched.add(place.parent)
    for place in touched:
        sync_folder(place)
    # What is left where a removal fails half-way must not look like a commit.
    done = commit.with_name("done")
    _remove(done)
    os.rename(commit, done)
    _remove(done)


def _names_gone(file: Path) -> list[str]:
    text = read_text(file)
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise DataError(f"{file}: is damaged; remove the folder {file.parent}")
    return found


def _inside(folder: Path, name: str) -> Path:
    """The place of a file in the folder; links on the way could lead out of it and are refused."""
    path = Path(name)
    if path.is_absolute() or ".." in path.parts:
        raise DataError(f"{folder}: {name!r} is not inside of the folder")
    for parent in list(path.parents)[:-1]:
        place = folder / parent
        if os.path.lexists(place) and (place.is_symlink() or not place.is_dir()):
            raise DataError(f"{place}: is a link or a file where a folder is needed; remove it")
    return folder / path


def _unmoved(folder: Path, error: OSError) -> DataError:
    return DataError(
        f"{folder}: the new files are complete, but cannot be moved to their places ({error.strerror}). They wait in "
        f"{folder / WORK}; the next command that reads the folder moves them. Make the folder writable first."
    )


def _sync_tree(folder: Path) -> None:
    for file in folder.rglob("*"):
        (sync_folder if file.is_dir() else sync_file)(file)
    sync_folder(folder)


def _remove(folder: Path) -> None:
    if folder.is_symlink():
        folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
