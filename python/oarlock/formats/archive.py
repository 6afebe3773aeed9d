"""Unpacks a zip file into a temporary folder, within limits, so that its recordings can be read."""

from __future__ import annotations

import shutil
import stat
import tempfile
import weakref
import zipfile
from pathlib import Path, PurePosixPath

from oarlock.formats.listing import MAX_FILES
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import begins_with, open_regular, shown_bytes

LIMIT_BYTES = 4 * 2**30
"""The largest contents of a zip file that are unpacked."""
LARGEST_RATIO = 200
"""Contents larger than this many times the zip file are refused: equal rows could fill any disk."""
_SMALL_BYTES = 16 * 2**20
_CHUNK_BYTES = 2**20
_MARKS = (b"PK\x03\x04", b"PK\x05\x06")


def is_zip(file: Path) -> bool:
    """True for a file that begins as a zip file does."""
    return any(begins_with(file, mark) for mark in _MARKS)


class Unpacked:
    """A temporary folder that is removed with this object.

    Args:
        folder: the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)


def unpacked(file: Path) -> Unpacked:
    """The contents of a zip file in a temporary folder.

    Raises:
        DataError: The file is damaged, encrypted or too large, or a name in it leads out of the folder.
    """
    made = Unpacked(Path(tempfile.mkdtemp(prefix="oarlock-")))
    try:
        with open_regular(file) as stream, zipfile.ZipFile(stream) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            places = _places(file, entries)
            _check_sizes(file, entries, made.folder)
            for entry, place in zip(entries, places, strict=True):
                _unpack(archive, entry, made.folder / place)
    except Exception as error:  # of damaged bytes zipfile raises whatever Python does
        made.remove()
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"{file}: cannot be unpacked ({error}). Unpack it yourself and give the folder."
        ) from error
    return made


def _places(file: Path, entries: list[zipfile.ZipInfo]) -> list[PurePosixPath]:
    """Path of each entry within the folder."""
    if len(entries) > MAX_FILES:
        raise DataError(
            f"{file}: has more than {MAX_FILES:,} files. Unpack it and give the folder of the recordings."
        )
    places = []
    for entry in entries:
        place = PurePosixPath(entry.filename.replace("\\", "/"))
        mode = entry.external_attr >> 16
        if place.is_absolute() or ".." in place.parts or not place.parts or ":" in place.parts[0]:
            raise DataError(
                f'{file}: contains the name "{entry.filename}", which leads out of it; it was not unpacked'
            )
        if stat.S_ISLNK(mode):
            raise DataError(f'{file}: contains the link "{entry.filename}"; it was not unpacked')
        if entry.flag_bits & 1:
            raise DataError(f"{file}: is encrypted. Unpack it yourself and give the folder.")
        places.append(place)
    return places


def _check_sizes(file: Path, entries: list[zipfile.ZipInfo], folder: Path) -> None:
    total = sum(entry.file_size for entry in entries)
    packed = max(1, file.stat().st_size)
    if total > LIMIT_BYTES:
        raise DataError(
            f"{file}: unpacks to {shown_bytes(total)}, more than {shown_bytes(LIMIT_BYTES)}. "
            "Unpack it yourself and give the folder."
        )
    if total > _SMALL_BYTES and total > LARGEST_RATIO * packed:
        raise DataError(
            f"{file}: unpacks to {total / packed:.0f} times its size, more than {LARGEST_RATIO} times. "
            "Unpack it yourself and give the folder."
        )
    free = shutil.disk_usage(folder).free
    if total > 0.9 * free:
        raise DataError(
            f"{file}: unpacks to {shown_bytes(total)}, but {folder} has {shown_bytes(free)} free. "
            "Unpack it yourself and give the folder."
        )


def _unpack(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, place: Path) -> None:
    """Write one file; never more bytes than the entry declares, because their sum was checked."""
    place.parent.mkdir(parents=True, exist_ok=True)
    left = entry.file_size
    with archive.open(entry) as source, place.open("xb") as target:
        while chunk := source.read(_CHUNK_BYTES):
            left -= len(chunk)
            if left < 0:
                raise DataError(f'{archive.filename}: "{entry.filename}" is larger than it declares')
            target.write(chunk)
