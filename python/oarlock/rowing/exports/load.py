"""`load_stroke_export`: recognises and reads exports of Quiske, RP3, NK and common ergometer logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType

from oarlock.rowing.exports import ergometers, nk_logbook, nk_speedcoach, quiske, rp3
from oarlock.rowing.exports.grid import Grid, grids, text_of
from oarlock.rowing.exports.refused import what_it_is
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.errors import DataError


@dataclass(frozen=True)
class ExportFormat:
    """A kind of file that is read.

    Attributes:
        name: as `load_stroke_export` and the command line take it.
        title: what writes such files.
        marks: names that the header of its strokes holds, whatever their order and capitals.
        read: from a file split into cells, and the place of the header.
    """

    name: str
    title: str
    marks: tuple[str, ...]
    read: Callable[[Grid, int], StrokeTable]


def _formats() -> Mapping[str, ExportFormat]:
    own = [
        ExportFormat("quiske", quiske.TITLE, quiske.MARKS, quiske.read),
        ExportFormat("rp3", rp3.TITLE, rp3.MARKS, rp3.read),
        ExportFormat("nk-logbook", nk_logbook.TITLE, nk_logbook.MARKS, nk_logbook.read),
    ]
    own += [
        ExportFormat(name, log.title, log.marks, partial(ergometers.read, log))
        for name, log in ergometers.LOGS.items()
    ]
    # its marks are the fewest, so it comes last
    own.append(ExportFormat("nk-speedcoach", nk_speedcoach.TITLE, nk_speedcoach.MARKS, nk_speedcoach.read))
    return MappingProxyType({one.name: one for one in own})


EXPORT_FORMATS: Mapping[str, ExportFormat] = _formats()
"""The kinds of files that `load_stroke_export` reads, by name."""


def load_stroke_export(path: str | PathLike[str], format: str | None = None) -> StrokeTable:
    """Read the strokes that a rowing device or an app has exported.

    Numbers are the device's own, in SI and radians, oar angles with the catch negative and the finish positive. What is
    computed here says so in its name or definition, see docs/stroke-exports.md. No row of a stroke is left out: what
    is missing is NaN with the reason. Positions (GPS) and names of people are not read.

    Args:
        path: of the file.
        format: one of `EXPORT_FORMATS`; None recognises it by the names of its columns.

    Returns:
        One row a stroke; curves, where the file has them, in `curves`; what is odd about the file in `notes`.

    Raises:
        DataError: the file cannot be read, is of another kind, or has a cell that is no number; file, line, column.
    """
    file = Path(path)
    text = text_of(file)
    found = grids(file, text)
    if format is not None and format not in EXPORT_FORMATS:
        raise DataError(f'the format "{format}" is not known; known are {", ".join(EXPORT_FORMATS)}')
    for one in EXPORT_FORMATS.values() if format is None else (EXPORT_FORMATS[format],):
        for grid in found:
            header = grid.header(one.marks)
            if header is not None:
                return one.read(grid, header)
    raise DataError(_unknown(file, text, found, format))


def _unknown(file: Path, text: str, found: Sequence[Grid], format: str | None) -> str:
    what = what_it_is(text, found)
    if what:
        return f"{file}: is {what}. Export the strokes as CSV."
    if format is not None:
        one = EXPORT_FORMATS[format]
        return (
            f"{file}: has no row with the columns {', '.join(one.marks)}, so it is not a file of {one.title}"
        )
    first = " ".join(text[:60].split())
    known = ", ".join(EXPORT_FORMATS)
    return f'{file}: is not a known stroke export (its text begins "{first}"); known are {known}'
