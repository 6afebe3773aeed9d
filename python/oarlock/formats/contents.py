"""The recordings of a file, folder or zip file: recognised by content and read. For `oarlock import PATH`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

from oarlock.formats.archive import Unpacked, is_zip, unpacked
from oarlock.formats.choices import UnclearError
from oarlock.formats.importers import FORMATS, ImportFormat
from oarlock.formats.listing import FileMatch, Listing, listed
from oarlock.formats.near_misses import nearest_text
from oarlock.formats.together import joined
from oarlock.recording.folder import INDEX_FILE
from oarlock.recording.recording import Recording, load_recording
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.progress import Progress, shown
from oarlock.storage.suggest import did_you_mean


@dataclass(frozen=True)
class Contents:
    """What was recognised in a place.

    Args:
        path: the place that was asked for.
        recordings: those that were recognised, each with its own name.
        others: files that belong to none of them.
        listing: all files.
    """

    path: Path
    recordings: tuple[FileMatch, ...]
    others: tuple[Path, ...]
    listing: Listing = field(repr=False)
    _unpacked: Unpacked | None = field(default=None, repr=False, compare=False)

    def only(self, name: str | None = None) -> FileMatch:
        """The recording of this name; without a name the only one.

        Raises:
            DataError: There is none of this name, or there are several and no name is given.
        """
        if name is None:
            if len(self.recordings) == 1:
                return self.recordings[0]
            names = ", ".join(one.name for one in self.recordings)
            raise DataError(
                f"{self.path}: contains {len(self.recordings)} recordings. If they are units of one recording, give "
                f"--together; else pick one: {names}."
            )
        for one in self.recordings:
            if one.name == name:
                return one
        valid = [one.name for one in self.recordings]
        raise DataError(f'{self.path}: contains no recording "{name}". {did_you_mean(name, valid)}')

    def relative(self, file: Path) -> str:
        """Name of a file below the place."""
        root = self.listing.root
        return file.relative_to(root).as_posix() if file != root and file.is_relative_to(root) else file.name


def find_recordings(path: str | PathLike[str], prefer: Sequence[str] = ()) -> Contents:
    """Recognise the recordings of a place by names and first bytes.

    Args:
        path: a file, folder or zip file.
        prefer: of formats that recognise the same files.

    Raises:
        UnclearError: none of several formats is preferred.
        DataError: nothing was recognised.
    """
    asked = place_of(path)
    kept = unpacked(asked) if asked.is_file() and is_zip(asked) and asked.suffix.lower() == ".zip" else None
    listing = listed(kept.folder if kept else asked)
    _refuse_own_recording(asked, listing)
    found = recognised(_without_own_folders(listing), prefer)
    if not found:
        raise DataError(nearest_text(asked, listing, FORMATS))
    used = {file for one in found for file in one.files}
    others = tuple(one.path for one in listing.files if one.path not in used)
    return Contents(asked, tuple(_with_own_names(found, listing.root)), others, listing, kept)


def import_recording(
    path: str | PathLike[str],
    pick: str | None = None,
    options: Mapping[str, object] | None = None,
    *,
    progress: Progress = None,
) -> Recording:
    """Read a recording of any format of `oarlock import`.

    Args:
        path: a file, folder or zip file.
        pick: which of several recordings.
        options: keywords of the format's reader.
        progress: True shows that it runs.

    Raises:
        DataError: nothing recognised or readable, or none of several picked.
    """
    with shown(progress, "reading"):
        contents = find_recordings(path)
        return read_found(contents.only(pick), options)


def read_recording(
    path: str | PathLike[str], pick: str | None = None, together: bool = False, *, progress: Progress = None
) -> Recording:
    """A recording of Oarlock as it is; anything else as `import_recording` reads it.

    Args:
        path: a recording's folder, or a file, a folder or a zip file of any format.
        pick: name of the recording, if the place has several.
        together: all recordings of the place are units of one.
        progress: True shows that it runs.

    Raises:
        DataError: as `import_recording`, or the units of one recording do not overlap in time.
    """
    if (Path(path) / INDEX_FILE).is_file():
        return load_recording(path)
    if not together:
        return import_recording(path, pick, progress=progress)
    return joined([(one.name, read_found(one)) for one in find_recordings(path).recordings])


def read_found(found: FileMatch, options: Mapping[str, object] | None = None) -> Recording:
    """Read a recording that was recognised.

    Raises:
        DataError: The files are not as their format demands.
    """
    return format_of(found).read(found.path, **{**found.options, **(options or {})})


def format_of(found: FileMatch) -> ImportFormat:
    """The entry of `FORMATS` that recognised a recording."""
    return next(one for one in FORMATS if one.name == found.format)


def recognised(listing: Listing, prefer: Sequence[str] = ()) -> list[FileMatch]:
    """The recordings of a listing in the order of their paths; of those that share files the one with most files.

    Raises:
        UnclearError: Several formats recognise the same files and none of them is in `prefer`.
    """
    found: list[FileMatch] = []
    for one in (one for one in FORMATS if not one.is_last_resort):
        found += one.find(listing)
    found = _without_parts(found, prefer)
    used = {file for one in found for file in one.files}
    rest = replace(listing, files=tuple(one for one in listing.files if one.path not in used))
    for one in (one for one in FORMATS if one.is_last_resort):
        found += one.find(rest)
    return sorted(found, key=lambda one: (one.files, one.name))


def _without_parts(found: list[FileMatch], prefer: Sequence[str]) -> list[FileMatch]:
    kept: list[FileMatch] = []
    for one in found:
        files = set(one.files)
        rivals = [other for other in found if other is not one and files & set(other.files)]
        if any(files < set(other.files) for other in rivals):
            continue
        equal = [other for other in rivals if other.format != one.format and not set(other.files) < files]
        if any(other.format in prefer for other in equal) and one.format not in prefer:
            continue
        if equal and one.format not in prefer:
            _refuse_unclear(one, equal)
        kept.append(one)
    return kept


def _refuse_unclear(one: FileMatch, others: Iterable[FileMatch]) -> None:
    choices = {other.format: other.about for other in (one, *others)}
    commands = "\n".join(f"oarlock import {name} {one.path}    ({about})" for name, about in choices.items())
    raise UnclearError(
        f"{one.path}: several formats recognise it. Name the format:\n{commands}", "format", choices
    )


def _without_own_folders(listing: Listing) -> Listing:
    """The listing without files in folders that are recordings of Oarlock."""
    own = {one.path.parent for one in listing.files if one.path.name == INDEX_FILE}
    return replace(listing, files=tuple(one for one in listing.files if one.path.parent not in own))


def _refuse_own_recording(path: Path, listing: Listing) -> None:
    root = listing.root if listing.root.is_dir() else listing.root.parent
    files = {one.path for one in listing.files}
    for own, place in (
        (root, path),
        (root / "recording", root / "recording"),
    ):  # the second is a live session's
        if own / INDEX_FILE in files:
            raise DataError(
                f"{place}: is a recording of Oarlock already. Use it as it is: `oarlock track {place} --model MODEL`."
            )


def _with_own_names(found: list[FileMatch], root: Path) -> list[FileMatch]:
    """Names that are unique within the place: with folders, format and a number where needed."""
    names = [one.name for one in found]
    for longer in (_with_folder, _with_format):
        names = [
            longer(one, root, name) if names.count(name) > 1 else name
            for one, name in zip(found, names, strict=True)
        ]
    counts: dict[str, int] = {}
    unique = []
    for name in names:
        counts[name] = counts.get(name, 0) + 1
        unique.append(name if counts[name] == 1 else f"{name}_{counts[name]}")
    return [replace(one, name=name) for one, name in zip(found, unique, strict=True)]


def _with_folder(one: FileMatch, root: Path, name: str) -> str:
    folder = one.path.parent
    parts = folder.relative_to(root).parts if folder != root and folder.is_relative_to(root) else ()
    return "_".join((*parts, name))


def _with_format(one: FileMatch, _root: Path, name: str) -> str:
    return f"{name}_{one.format}"
