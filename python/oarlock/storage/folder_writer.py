"""Replaces what Oarlock wrote in a folder as a whole, and lists it; savers and readers of folders use it.

New files are written into `.oarlock/new` inside the folder and synced. Its rename to `.oarlock/commit` is the one
instant that counts: before it the folder is the old one, after it the new one, whose files the next reader or writer
moves if the process is killed. `oarlock-manifest.toml` lists what is Oarlock's, by SHA-256; the rest is never touched.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from oarlock.storage.errors import DataError
from oarlock.storage.paths import COMMIT, STAGED, AnyPath
from oarlock.storage.regular_file import open_regular
from oarlock.storage.toml import TomlTable, toml_text
from oarlock.storage.write_file import check_replaceable, is_staged, sync_path, unwritable, write_file

MANIFEST, FORMAT = "oarlock-manifest.toml", 1
SESSION_FILE = "session.toml"
"""Who was recorded, when and where. People edit it, so it is never listed; it is replaced with the rest."""
OPEN_FILES_STAY = os.name == "nt"
_HEAD = "# What Oarlock wrote, with SHA-256. A file that differs is not read: remove its line if you changed it.\n"
_TREE, _LOCK = "tree", STAGED.with_name("lock")


@dataclass(frozen=True)
class Manifest:
    """The files of a folder that are Oarlock's: for each kind ("recording", "track", ...) their hashes by path."""

    folder: Path
    kinds: Mapping[str, Mapping[str, str]]

    @property
    def sha256(self) -> dict[str, str]:
        """The hashes of all files."""
        return {name: value for files in self.kinds.values() for name, value in files.items()}

    def is_unchanged(self, name: str) -> bool:
        """Whether a file is a regular file, listed, and as it was written."""
        file, value = self.folder / name, self.sha256.get(name)
        return bool(value) and file.is_file() and not file.is_symlink() and _sha256_of(file) == value

    def check(self, names: Iterable[str]) -> None:
        """Refuse listed files that differ from what was written. After reading, it also notices a writer.

        Raises:
            DataError: a file was changed or cannot be read.
        """
        for name in names:
            if name in self.sha256 and _sha256_of(self.folder / name) != self.sha256[name]:
                raise DataError(
                    f"{self.folder / name}: is not the file that was written here (its SHA-256 differs). Write the "
                    f"folder again; if you changed it on purpose, remove its line from {self.folder / MANIFEST}."
                )

    def check_free(self, name: str, force: bool = False) -> None:
        """Refuse to replace a file of somebody else. Ours are those that are listed and unchanged.

        Raises:
            DataError: it exists, also as a link, and `force` is not set; or no file can be there.
        """
        file = _place(self.folder, name)
        check_replaceable(file)
        if os.path.lexists(file) and not (force or self.is_unchanged(name)):
            raise DataError(
                f"{file} exists, and no manifest says that Oarlock wrote it and nobody changed it\n"
                "Choose another place, move the file away, or replace it with --force (force=True)."
            )


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder, after the files of a run that was killed are moved; empty if it has none.

    Raises:
        DataError: they cannot be moved to their places, or the manifest is damaged.
    """
    if (folder / COMMIT).is_dir():
        with _locked(folder):
            pass
    if not (folder / MANIFEST).is_file():
        return Manifest(folder, {})
    top = TomlTable.read(folder / MANIFEST)
    top.check_format(FORMAT)
    top.check_keys({"format", "sha256"})
    kinds = {}
    for kind in top.table("sha256").values:
        table = top.table("sha256").table(kind)
        kinds[kind] = {name: table.string(name) for name in table.values}
        for path in map(Path, table.values):
            if path.is_absolute() or ".." in path.parts:
                raise DataError(f"{table.where(str(path))}: is damaged; write the folder again")
            place = folder / path.parent
            if path.parts[1:] == (MANIFEST,) and (place / MANIFEST).is_file() and not place.is_symlink():
                # Pages that were added to `truth/` later are ours, too.
                nested = read_manifest(place).sha256 | {MANIFEST: _sha256_of(place / MANIFEST)}
                kinds[kind] |= {f"{path.parent}/{name}": value for name, value in nested.items()}
    return Manifest(folder, kinds)


@contextmanager
def replaced_folder(folder: AnyPath, kind: str, force: bool = False, adds: bool = False) -> Iterator[Path]:
    """Context that gives the folder to write into; at its end the files are in `folder`, in place of ours before.

    Inside of another such context it is the folder itself: then the outer one moves its files.

    Args:
        folder: the folder to replace; it is made if it does not exist.
        kind: what it contains: "recording", "track", ...; "": what its manifest lists first, if it has one.
        force: replace files of others, too.
        adds: keep ours that are not written again.

    Raises:
        DataError: another process writes there, a file of others is in the way, or the disk is full. Nothing changed.
    """
    place = Path(folder)
    if is_staged(place):
        place.mkdir(parents=True, exist_ok=True)
        yield place
        _write_manifest(place, {kind: _hashes(place)})
        return
    with _locked(place):
        (place / STAGED / _TREE).mkdir(parents=True)
        yield place / STAGED / _TREE
        _commit(place, kind, force, adds)


def _commit(folder: Path, kind: str, force: bool, adds: bool) -> None:
    new, before = folder / STAGED, read_manifest(folder)
    kind = kind or next(iter(before.kinds), "")
    staged, ours = _files_under(new / _TREE), before.kinds.get(kind, {})
    gone = [] if adds or not ours else [name for name in (*ours, SESSION_FILE) if name not in staged]
    for name in (*staged, *gone):
        before.check_free(name, force or name == MANIFEST or Path(name).name == SESSION_FILE)
    if kind:
        files = {**(ours if adds else {}), **_hashes(new / _TREE)}
        others = {k: {n: v for n, v in old.items() if n not in files} for k, old in before.kinds.items()}
        _write_manifest(new / _TREE, {kind: {}} | others | {kind: files})
    _write_manifest(new, {"gone": dict.fromkeys(gone, "")})
    for path in (*new.rglob("*"), new):
        sync_path(path)
    os.rename(new, folder / COMMIT)


def _finish(folder: Path) -> None:
    """Move the files of a commit to their places; a process that was killed may have begun it."""
    commit = folder / COMMIT
    if commit.is_dir():
        sync_path(commit.parent)
        for name in read_manifest(commit).sha256:
            _place(folder, name).unlink(missing_ok=True)
            with suppress(OSError):
                (folder / name).parent.rmdir()
        for name in (staged := _files_under(commit / _TREE)):
            file = _place(folder, name)
            file.parent.mkdir(parents=True, exist_ok=True)
            os.replace(commit / _TREE / name, file)
        for parent in {folder, *((folder / name).parent for name in staged)}:
            sync_path(parent)
        # What is left where a removal fails half-way must not look like a commit.
        os.rename(commit, folder / STAGED)
    shutil.rmtree(folder / STAGED, ignore_errors=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Locks a folder, which is made if it does not exist; files of a commit are moved before and after."""
    try:
        is_new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        with _lock(folder) as lock:
            try:
                _finish(folder)
                yield
            finally:
                _finish(folder)
                if OPEN_FILES_STAY:  # there, a file that the next writer has opened stays, too
                    lock.close()
                with suppress(OSError):
                    (folder / _LOCK).unlink()
                    (folder / _LOCK).parent.rmdir()
                    if is_new:
                        folder.rmdir()
    except OSError as error:
        name = str(error.filename or "")
        if name not in str(folder) and str(folder) not in name:  # of a file that the caller reads meanwhile
            raise
        if (folder / COMMIT).is_dir():
            why = f"{folder}: the new files are complete in {COMMIT}, but cannot be moved ({error.strerror})"
            raise DataError(f"{why}. Make the folder writable; the next command moves them.") from error
        raise unwritable(folder, error) from error


def _lock(folder: Path) -> IO[bytes]:
    """The lock of a folder. It ends with the process, also if that is killed."""
    work = folder / _LOCK.parent
    # The process that had it before may just remove it.
    with suppress(FileNotFoundError, FileExistsError), ExitStack() as ending:
        work.mkdir(exist_ok=True)
        for path in (work, *work.glob("*"), *work.glob(f"*/{_TREE}")):
            if path.is_symlink():
                raise DataError(f"{path}: is a link; remove it")
        lock = ending.enter_context((folder / _LOCK).open("ab"))
        with suppress(BlockingIOError, PermissionError):  # Linux and macOS; Windows
            if sys.platform == "win32":
                import msvcrt

                msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
            else:
                import fcntl

                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(lock.fileno()), os.stat(folder / _LOCK)):
                ending.pop_all()
                return lock
    raise DataError(f"{folder}: another run is writing there. Wait for its end, or choose another folder.")


def _write_manifest(folder: Path, kinds: Mapping[str, Mapping[str, str]]) -> None:
    write_file(folder / MANIFEST, _HEAD + toml_text({"format": FORMAT, "sha256": kinds}))


def _hashes(folder: Path) -> dict[str, str]:
    names = (n for n in _files_under(folder) if n != MANIFEST and Path(n).name != SESSION_FILE)
    return {name: _sha256_of(folder / name) for name in names}


def _sha256_of(file: Path) -> str:
    with open_regular(file) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _files_under(folder: Path) -> list[str]:
    return sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if not file.is_dir())


def _place(folder: Path, name: str) -> Path:
    """The place of a file in the folder; links on the way could lead out of it and are refused."""
    for parent in Path(name).parents[:-1]:
        place = folder / parent
        if place.is_symlink() or (place.exists() and not place.is_dir()):
            raise DataError(f"{place}: is a link or a file where a folder is needed; remove it")
    return folder / name
