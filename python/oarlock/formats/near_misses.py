"""Why no format recognises the files of a place, for the error of `oarlock import PATH`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from oarlock.formats.importers import ImportFormat
from oarlock.formats.listing import ListedFile, Listing
from oarlock.storage.errors import DataError

_MOST_FILES = 6
_READ_BYTES = 64 * 2**20
"""Larger files are not read for a reason only."""


def nearest_text(asked: Path, listing: Listing, formats: Sequence[ImportFormat]) -> str:
    """What was looked at, per file the nearest format and why it is not that one, and what to try."""
    if not listing.files:
        return f"{asked}: contains no files"
    shown = [_line(one, listing, formats) for one in _likeliest(listing, formats)]
    more = len(listing.files) - len(shown)
    looked = f"{len(listing.files)} files were" if len(listing.files) > 1 else "One file was"
    return "\n".join(
        [
            f"{asked}: no recording was recognised. {looked} looked at:",
            *shown,
            *([f"and {more} more"] if more > 0 else []),
            "For a table of text write a mapping file and use `oarlock import csv mapping.toml`; see docs/import.md.",
        ]
    )


def _likeliest(listing: Listing, formats: Sequence[ImportFormat]) -> list[ListedFile]:
    """The first files, those whose name ends as a format's file does before the others."""
    known = {suffix for one in formats for suffix in one.suffixes}
    return sorted(listing.files, key=lambda one: one.path.suffix.lower() not in known)[:_MOST_FILES]


def _line(one: ListedFile, listing: Listing, formats: Sequence[ImportFormat]) -> str:
    name = one.path.relative_to(listing.root).as_posix() if one.path != listing.root else one.path.name
    if one.size_bytes == 0:
        return f"{name}: is empty"
    near = [known for known in formats if one.path.suffix.lower() in known.suffixes]
    if not near:
        return f"{name}: no format has files that end with {one.path.suffix or 'nothing'}"
    # Data sets share the suffix .mat: the last resort of a suffix explains best why a table is none.
    nearest = next((known for known in near if known.is_last_resort), near[0])
    if one.size_bytes > _READ_BYTES:
        return f"{name}: nearest format {nearest.name}, which did not recognise it"
    return f"{name}: nearest format {nearest.name}: {_reason(one.path, nearest)}"


def _reason(file: Path, nearest: ImportFormat) -> str:
    """First line of what the reader says, without the file's name."""
    try:
        nearest.read(file)
    except DataError as error:
        first = str(error).splitlines()[0]
        return first.removeprefix(str(file)).lstrip(": ") or "it cannot be read"
    return f"it can be read with `oarlock import {nearest.name} {file}`"
