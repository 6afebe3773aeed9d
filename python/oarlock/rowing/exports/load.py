"""`load_export`, `load_stroke_export`: recognise and read what rowing devices, watches and apps export."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType

from oarlock.rowing.exports import ergometers, nk_logbook, nk_speedcoach, quiske, rowingdata, rp3
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.exports.fit import is_fit, read_fit
from oarlock.rowing.exports.grid import CellGrid, grids, text_of
from oarlock.rowing.exports.peach import BEGIN, is_peach, read_peach
from oarlock.rowing.exports.starts import epoch_of_export
from oarlock.rowing.exports.tcx import ROOT, read_tcx
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.errors import DataError

_BY_HEADER = (
    (
        ("Interval", "Type", "Distance(m)", "Stroke", "Split(sec)"),
        "a SpeedCoach export with a row every few metres, not a row a stroke",
    ),
    (
        ("Date", "Description", "Work Time (Formatted)"),
        "a season's list of workouts of the Concept2 logbook: a row is a workout, not a stroke. In the logbook, open a "
        "workout and export its CSV",
    ),
)


@dataclass(frozen=True)
class ExportFormat:
    """A kind of file of text in cells that is read.

    Attributes:
        name: as `load_stroke_export` and the command line take it.
        title: what writes such files.
        marks: names that the header of its strokes holds, whatever their order and capitals.
        read: from a file split into cells, and the place of the header.
    """

    name: str
    title: str
    marks: tuple[str, ...]
    read: Callable[[CellGrid, int], StrokeTable | Activity]


def _formats() -> Mapping[str, ExportFormat]:
    own = [
        ExportFormat("quiske", quiske.TITLE, quiske.MARKS, quiske.read),
        ExportFormat("rp3", rp3.TITLE, rp3.MARKS, rp3.read),
        ExportFormat("rowingdata", rowingdata.TITLE, rowingdata.MARKS, rowingdata.read),
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
"""The kinds of CSV files that `load_export` reads, by name. FIT, TCX and Peach files are known by their contents."""
FILE_KINDS = ("fit", "tcx", "peach")
_HEAD = 4000


def load_export(
    path: str | PathLike[str], format: str | None = None, seat: int | None = None
) -> StrokeTable | Activity:
    """Read what a rowing device, a watch or an app has exported: strokes, or points in time where it has none.

    Numbers are the device's own, in SI and radians, oar angles with the catch negative and the finish positive. What is
    computed here says so in its name or definition, see docs/stroke-exports.md. No row of a stroke is left out: what
    is missing is NaN with the reason. No strokes are made from cadence. Names of people are not read, and positions
    (GPS) only into an activity.

    Args:
        path: of the file.
        format: one of `EXPORT_FORMATS`, or ``fit``, ``tcx`` or ``peach``; None recognises it by its contents.
        seat: whose strokes, of a Peach file with several seats.

    Returns:
        A `StrokeTable` with one row a stroke, or an `Activity`. Both have `epoch`, the moment of their 0 s if the file
        says it, `duration_s`, and what is odd about the file in `notes`.

    Raises:
        DataError: the file cannot be read, is of another kind, or has a cell that is no number; file, line, column.
    """
    file = Path(path)
    if format is not None and format not in (*EXPORT_FORMATS, *FILE_KINDS):
        known = ", ".join((*EXPORT_FORMATS, *FILE_KINDS))
        raise DataError(f'the format "{format}" is not known; known are {known}')
    if format == "fit" or (format is None and is_fit(file)):
        return read_fit(file)
    text = "" if format == "tcx" else text_of(file)
    if format == "tcx" or (format is None and ROOT in text[:_HEAD]):
        return read_tcx(file)
    found = grids(file, text)
    if format == "peach" or (format is None and is_peach(text)):
        return read_peach(_by_tabs(file, found), seat)
    for one in EXPORT_FORMATS.values() if format is None else (EXPORT_FORMATS[format],):
        for grid in found:
            header = grid.header(one.marks)
            if header is not None:
                return replace(one.read(grid, header), epoch=epoch_of_export(one.name, grid, header))
    raise DataError(_unknown(file, text, found, format))


def load_stroke_export(path: str | PathLike[str], format: str | None = None) -> StrokeTable:
    """As `load_export`, for files with strokes.

    Raises:
        DataError: as `load_export`; or the file has points in time and no strokes.
    """
    found = load_export(path, format)
    if isinstance(found, Activity):
        raise DataError(
            f"{path}: contains {len(found)} points in time and no strokes. Export the strokes as CSV, or read the "
            "points with load_export."
        )
    return found


def _by_tabs(file: Path, found: Sequence[CellGrid]) -> CellGrid:
    """The one of the grids in which sections begin."""
    for grid in found:
        if any(row and row[0] == BEGIN and row[1:] for row in grid.cells):
            return grid
    raise DataError(
        f"{file}: has no section that begins with {BEGIN}, so it is no text export of Peach PowerLine"
    )


def _unknown(file: Path, text: str, found: Sequence[CellGrid], format: str | None) -> str:
    for marks, what in _BY_HEADER:
        if any(grid.header(marks) is not None for grid in found):
            return f"{file}: is {what}. Export the strokes as CSV."
    if format is not None:
        one = EXPORT_FORMATS[format]
        return (
            f"{file}: has no row with the columns {', '.join(one.marks)}, so it is not a file of {one.title}"
        )
    first = " ".join(text[:60].split())
    known = ", ".join(EXPORT_FORMATS)
    return f'{file}: is not a known stroke export (its text begins "{first}"); known are {known}'
