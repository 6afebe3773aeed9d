"""Replaces what Oarlock wrote in a folder as a whole, and lists it; savers and readers of folders use it.

New files are written into `.oarlock/new` inside the folder and synced. The rename of `.oarlock/new` to
`.oarlock/commit` is the one instant that counts: before it the folder is the old one, after it the new one, whose files
only need to be moved to their places. If the process was killed, the next reader or writer moves them.
`oarlock-manifest.toml` lists the files that are Oarlock's, with their SHA-256. All others are never touched.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import stat
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular
from oarlock.storage.toml import TomlTable, toml_text
from oarlock.storage.write_file import (
    STAGED,
    WORK,
    check_replaceable,
    is_staged,
    sync_file,
    sync_folder,
    unwritable,
    write_file,
)

MANIFEST = "oarlock-manifest.toml"
SESSION_FILE = "session.toml"
"""Who was recorded, when and where. People edit it, so it is never listed; it is replaced with the rest."""
FORMAT = 1
OPEN_FILES_STAY = os.name == "nt"
"""Whether the system refuses to remove a file that is open."""
_HEAD = """\
# The files that Oarlock wrote into this folder, with their SHA-256. A file that differs is not read.
# If you changed a file on purpose, remove its line.
"""
_TREE, _COMMIT = "tree", "commit"
_DISK = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EROFS, errno.ENOLCK, errno.ENOTSUP)


@dataclass(frozen=True)
class Manifest:
    """What stands in `oarlock-manifest.toml`.

    Args:
        folder: where.
        kinds: for each thing that the folder contains ("recording", "track", ...) the hash of each file, by its path in
            the folder with `/`.
    """

    folder: Path
    kinds: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """The manifest of a folder; it is empty in folders that a person made.

        Raises:
            DataError: it is damaged.
        """
        if not (folder / MANIFEST).is_file():
            return cls(folder)
        top = TomlTable.read(folder / MANIFEST)
        top.check_format(FORMAT)
        top.check_keys({"format", "sha256"})
        kinds = {kind: top.table("sha256").table(kind) for kind in top.table("sha256").values}
        for table in kinds.values():
            for name in table.values:
                if Path(name).is_absolute() or ".." in Path(name).parts:
                    raise DataError(f"{table.where(name)}: is damaged; write the folder again")
        return cls(
            folder, {kind: {n: table.string(n) for n in table.values} for kind, table in kinds.items()}
        )

    @property
    def sha256(self) -> dict[str, str]:
        """The hashes of all files."""
        return {name: value for files in self.kinds.values() for name, value in files.items()}

    def with_nested(self) -> Manifest:
        """With the files of manifests in listed folders, such as that of `truth/`: pages added there are ours, too."""
        kinds = {kind: dict(files) for kind, files in self.kinds.items()}
        for files in kinds.values():
            for name in [name for name in files if Path(name).name == MANIFEST]:
                place = Path(name).parent
                is_link = (self.folder / place).resolve() != self.folder.resolve() / place
                if not is_link and (nested := Manifest.read(self.folder / place).sha256):
                    files |= {(place / own).as_posix(): value for own, value in nested.items()}
                    files[name] = _sha256_of(self.folder / name)
        return Manifest(self.folder, kinds)

    def with_files(self, kind: str, files: Mapping[str, str]) -> Manifest:
        """With these as the files of a kind."""
        others = {
            other: {name: value for name, value in hashes.items() if name not in files}
            for other, hashes in self.kinds.items()
            if other != kind
        }
        return Manifest(self.folder, {kind: files, **others})

    def text(self) -> str:
        """The manifest as TOML."""
        kinds = {kind: dict(files) for kind, files in self.kinds.items() if files}
        return _HEAD + toml_text({"format": FORMAT, "sha256": kinds})

    def is_unchanged(self, name: str) -> bool:
        """Whether a file is a regular file, listed, and as it was written."""
        file = self.folder / name
        is_listed = name in self.sha256 and file.is_file() and not file.is_symlink()
        return is_listed and _sha256_of(file) == self.sha256[name]

    def check(self, names: Iterable[str]) -> None:
        """Refuse files that are listed and differ from what was written. Those that are not listed pass.

        Call it after the files were read: then it also refuses what a writer replaced in the meantime.

        Raises:
            DataError: a file was changed or cannot be read; names it.
        """
        for name in names:
            if name in self.sha256 and _sha256_of(self.folder / name) != self.sha256[name]:
                raise DataError(
                    f"{self.folder / name}: is not the file that was written here (its SHA-256 differs from "
                    f"{MANIFEST}). Write the folder again; if you changed the file on purpose, remove its line from "
                    f"{self.folder / MANIFEST}."
                )

    def check_free(self, name: str, force: bool = False) -> None:
        """Refuse to replace a file of somebody else. Ours are those that are listed and unchanged.

        Raises:
            DataError: it exists, also as a link, and `force` is not set; or it is a folder or a device; or a link or a
                file is where its folder is needed.
        """
        file = _place(self.folder, name)
        check_replaceable(file)
        if os.path.lexists(file) and not (force or self.is_unchanged(name)):
            raise DataError(
                f"{file} exists and was not written by Oarlock, or was changed since\n"
                "Choose another place, move the file away, or replace it with --force (force=True)."
            )


@contextmanager
def replaced_folder(
    folder: str | PathLike[str], kind: str, force: bool = False, adds: bool = False
) -> Iterator[Path]:
    """Context that gives the folder to write into; at its end the files are in `folder`, in place of ours before.

    Inside of another such context it is the folder itself: then the outer one moves its files.

    Args:
        folder: the folder to replace; it is made if it does not exist.
        kind: what it will contain, for the manifest: "recording", "track", ...; "": the files are not listed.
        force: replace files of others, too.
        adds: keep ours that are not written again.

    Raises:
        DataError: another process writes into the folder, a file of somebody else is in the way, or the disk is full.
            The folder is unchanged then.
    """
    place = Path(folder)
    if is_staged(place):
        place.mkdir(parents=True, exist_ok=True)
        yield place
        write_file(place / MANIFEST, Manifest(place).with_files(kind, _hashes(place)).text())
        return
    new = place.joinpath(*STAGED)
    with ExitStack() as ending:
        try:
            if not place.exists():
                ending.callback(_remove_if_empty, place)
            ending.enter_context(_lock(place))
            _finish(place)
            _remove(new)
            ending.callback(_remove, new)
            (new / _TREE).mkdir(parents=True)
            yield new / _TREE
            _commit(place, kind, force, adds)
            _finish(place)
        except OSError as error:
            at, whole = Path(str(error.filename)).absolute(), place.absolute()
            # Others, such as of a file that the caller reads meanwhile, are not of this folder.
            if error.errno in _DISK or at.is_relative_to(whole) or whole.is_relative_to(at):
                raise unwritable(place, error) from error
            raise


def check_empty(folder: Path, force: bool = False, beside: str = "") -> None:
    """Refuse a folder that contains files, but for `beside`: nothing is replaced without `force`.

    Raises:
        DataError: it contains files, and `force` is not set; or it is a file.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise DataError(f"{folder} is a file; --out (out) names a folder")
    if force or not folder.is_dir():
        return
    read_manifest(folder)  # a run that was killed may have left files on their way
    if any(entry.name not in (WORK, beside) for entry in folder.iterdir()):
        raise DataError(
            f"{folder} exists and contains files\n"
            "Choose another folder, or replace what Oarlock wrote there with --force (force=True)."
        )


@contextmanager
def added_files(folder: Path, force: bool = False, kind: str = "") -> Iterator[Path]:
    """Context that gives an empty folder to write into; at its end its files are added to those in `folder`.

    Args:
        folder: where the files shall be. If it has a manifest, they are listed there.
        force: replace files of others, too.
        kind: what the folder is, so that it gets a manifest if it has none; "": any folder of a user.

    Raises:
        DataError: as `replaced_folder`.
    """
    with replaced_folder(folder, kind or next(iter(read_manifest(folder).kinds), ""), force, True) as stage:
        yield stage


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Context that gives a temporary folder, in which nothing is synced to the disk: its files are read and gone."""
    with TemporaryDirectory() as scratch:
        folder = Path(scratch, *STAGED)
        folder.mkdir(parents=True)
        yield folder


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder that is about to be read, after the files of a run that was killed are moved.

    Raises:
        DataError: they cannot be moved to their places, or the manifest is damaged.
    """
    if (folder / WORK / _COMMIT).is_dir():
        try:
            with _lock(folder):
                _finish(folder)
        except OSError as error:
            raise _unmoved(folder, error) from error
    return Manifest.read(folder)


def _commit(folder: Path, kind: str, force: bool, adds: bool) -> None:
    new = folder.joinpath(*STAGED)
    before = Manifest.read(folder).with_nested()
    staged, ours = _files_under(new / _TREE), dict(before.kinds.get(kind, {}))
    gone = [] if adds or not ours else [name for name in (*ours, SESSION_FILE) if name not in staged]
    for name in (*staged, *gone):
        before.check_free(name, force or name == MANIFEST or Path(name).name == SESSION_FILE)
    if kind:
        files = (ours if adds else {}) | _hashes(new / _TREE)
        write_file(new / _TREE / MANIFEST, before.with_files(kind, files).text())
    write_file(new / MANIFEST, Manifest(new, {"gone": dict.fromkeys(gone, "")}).text())
    for file in new.rglob("*"):
        (sync_folder if file.is_dir() else sync_file)(file)
    sync_folder(new)
    os.rename(new, folder / WORK / _COMMIT)


def _finish(folder: Path) -> None:
    """Move the files of a commit to their places; a process that was killed may have begun it."""
    commit = folder / WORK / _COMMIT
    tree = commit / _TREE
    if not commit.is_dir():
        return
    if commit.is_symlink() or tree.is_symlink():
        raise DataError(f"{commit}: is a link; remove it")
    try:
        sync_folder(commit.parent)
        changed = {folder}
        for name in Manifest.read(commit).sha256:
            file = _place(folder, name)
            file.unlink(missing_ok=True)
            if file.parent != folder:
                _remove_if_empty(file.parent)
        for name in _files_under(tree):
            file = _place(folder, name)
            file.parent.mkdir(parents=True, exist_ok=True)
            os.replace(tree / name, file)
            changed.add(file.parent)
        for parent in changed:
            sync_folder(parent)
        # What is left where a removal fails half-way must not look like a commit.
        os.rename(commit, folder.joinpath(*STAGED))
    except OSError as error:
        raise _unmoved(folder, error) from error
    _remove(folder.joinpath(*STAGED))


@contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """Locks a folder, which is made if it does not exist. The lock ends with its process, also if that is killed."""
    work, file = folder / WORK, folder / WORK / "lock"
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # the writer before us is just removing it
            with suppress(FileExistsError):
                work.mkdir()
            if not stat.S_ISDIR(os.lstat(work).st_mode):
                raise DataError(f"{work}: is a link or a file; remove it, then run the command again")
            number = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
            try:
                if not _is_locked(number):
                    raise DataError(
                        f"{folder}: another run is writing into this folder. Wait for its end, or choose another one."
                    )
                if os.path.samestat(os.fstat(number), os.stat(file)):
                    break
            except BaseException:
                os.close(number)
                raise
            os.close(number)
    try:
        yield
    finally:
        _unlock(file, number)


def _unlock(file: Path, number: int) -> None:
    if OPEN_FILES_STAY:  # there a file that the next writer has opened stays, too
        os.close(number)
    with suppress(OSError):  # files on their way may be in the folder
        file.unlink()
        file.parent.rmdir()
    if not OPEN_FILES_STAY:
        os.close(number)


def _is_locked(number: int) -> bool:
    """Lock an open file; False if somebody else has locked it."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # Linux and macOS; Windows
        return False
    return True


def _hashes(folder: Path) -> dict[str, str]:
    names = (n for n in _files_under(folder) if n != MANIFEST and Path(n).name != SESSION_FILE)
    return {name: _sha256_of(folder / name) for name in names}


def _sha256_of(file: Path) -> str:
    with open_regular(file) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _files_under(folder: Path) -> list[str]:
    """Paths of all files in a folder and its folders, with `/`, in order."""
    return sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if not file.is_dir())


def _place(folder: Path, name: str) -> Path:
    """The place of a file in the folder; links on the way could lead out of it and are refused."""
    for parent in Path(name).parents[:-1]:
        place = folder / parent
        if place.is_symlink() or (place.exists() and not place.is_dir()):
            raise DataError(f"{place}: is a link or a file where a folder is needed; remove it")
    return folder / name


def _remove(folder: Path) -> None:
    if folder.is_symlink():
        folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _unmoved(folder: Path, error: OSError) -> DataError:
    return DataError(
        f"{folder}: the new files are complete, but cannot be moved to their places ({error.strerror}). They wait in "
        f"{folder / WORK}; the next command that reads the folder moves them. Make the folder writable first."
    )
