"""The files of a place and what formats recognise in them: `Listing`, `FileMatch`. For `oarlock import PATH`.

A format's module has ``find_NAME(listing) -> list[FileMatch]`` beside its reader. It looks at names and first bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.regular_file import open_regular

HEAD_BYTES = 16_384
MAX_FILES = 20_000


@dataclass(frozen=True)
class ListedFile:
    """A file beneath the place that was asked for.

    Args:
        path: of the file.
        size_bytes: its size.
        head: its first `HEAD_BYTES` bytes.
    """

    path: Path
    size_bytes: int
    head: bytes = field(repr=False)

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """The whole lines of the head without their ends; empty if it is no text."""
        text = _decoded(self.head)
        lines = text.splitlines()
        whole = len(self.head) < HEAD_BYTES or text.endswith(("\n", "\r"))
        return tuple(lines if whole else lines[:-1])


@dataclass(frozen=True)
class Listing:
    """The regular files of a folder and its folders, in the order of their paths, or one file."""

    root: Path
    files: tuple[ListedFile, ...]

    def suffixed(self, *suffixes: str) -> tuple[ListedFile, ...]:
        """The files whose names end so, in small or capital letters, such as ".csv"."""
        return tuple(f for f in self.files if f.path.name.lower().endswith(suffixes))


@dataclass(frozen=True)
class FileMatch:
    """A recording that a format recognises.

    Args:
        format: name of the entry of `FORMATS`.
        path: file or folder for its reader.
        files: all files that the reader will read.
        name: a name for the recording, such as the trial's.
        about: what it is, in a few words: maker, device, number of units.
        options: further keywords of the reader.
        start: moment of the first sample as text, if the first bytes say it.
    """

    format: str
    path: Path
    files: tuple[Path, ...]
    name: str
    about: str
    options: Mapping[str, object] = field(default_factory=dict)
    start: str = ""


def listed(path: str | Path) -> Listing:
    """The files at a place.

    Raises:
        DataError: there is nothing, it cannot be read, or there are more than `MAX_FILES` files.
    """
    root = place_of(path)
    if not root.exists():
        raise DataError(f"{root}: does not exist")
    if not root.is_dir():
        return Listing(root, (_listed_file(root),))
    files = []
    for place in sorted(root.rglob("*")):
        if place.name.startswith(".") or not place.is_file():
            continue
        files.append(_listed_file(place))
        if len(files) > MAX_FILES:
            raise DataError(f"{root}: has more than {MAX_FILES:,} files. Give the folder of the recordings.")
    return Listing(root, tuple(files))


def _listed_file(path: Path) -> ListedFile:
    with open_regular(path) as stream:
        return ListedFile(path, path.stat().st_size, stream.read(HEAD_BYTES))


def _decoded(head: bytes) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return head.decode("utf-16", "ignore")
    if b"\0" in head:
        return ""
    return head.decode("utf-8-sig", "replace")
