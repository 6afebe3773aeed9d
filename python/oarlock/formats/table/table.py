"""Reads tables of text with clear names of columns, without a mapping file, for `oarlock import PATH`."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike, path
from pathlib import Path

from oarlock.formats.columns import read_columns
from oarlock.formats.csv import read_mapped
from oarlock.formats.listing import FileMatch, Listing
from oarlock.formats.table.columns import table_columns
from oarlock.formats.table.layout import table_start
from oarlock.formats.table.mapping import Given, TableMapping, table_mapping
from oarlock.formats.table.time_column import column_names, first_moment
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.delimited import ColumnLayout
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.write_file import write_file

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".sto")
_SHOWN_UNITS = 8


def read_table(
    file: str | PathLike[str],
    accel_unit: str | None = None,
    gyro_unit: str | None = None,
    mag_unit: str | None = None,
    time_unit: str | None = None,
    rate_hz: float | None = None,
    save_mapping: str | PathLike[str] | None = None,
) -> Recording:
    """Read the inertial units of a table: delimiter, decimal mark, units and sensors are found from header and values.

    Args:
        file: the table.
        accel_unit: unit of all accelerometers: g, m/s2, mg, mm/s2; None: from the header, or from gravity.
        gyro_unit: unit of all gyroscopes: rad/s, deg/s; None: from the header, or from the rotation of gravity.
        mag_unit: unit of all magnetometers: a.u., uT, gauss, mG, nT, T; None: from the header, or from the norm.
        time_unit: unit of the time column, as in a mapping file; None: from the header or the values.
        rate_hz: rows in a second, of a file without time stamps.
        save_mapping: file for the mapping that was used.

    Returns:
        One stream for each unit, named as in the columns. ``meta["source"]["notes"]`` has what was recognised.

    Raises:
        UnclearError: a unit or the time is not clear; the error has the choices.
        DataError: it is no such table, or a cell is not a number.
    """
    place = place_of(file)
    found = table_mapping(place, Given(accel_unit, gyro_unit, mag_unit, time_unit, rate_hz))
    recording = read_mapped(found.checked(), place.parent, {"format": "table", "file": place.name})
    if save_mapping is not None:
        _save_mapping(found, place_of(save_mapping))
    return Recording(recording.streams, _with_notes(recording.meta, found.notes))


def read_table_orientations(file: str | PathLike[str]) -> dict[str, Floats]:
    """Read the orientations that the units computed themselves.

    Args:
        file: the table, as for `read_table`; the rows are those of its time column.

    Returns:
        Name of unit -> (T, 4) quaternions as in the file, scalar first. Which frame they rotate from which is the
        maker's choice: read its manual. Units without columns of a quaternion are left out.

    Raises:
        DataError: as `read_table`.
    """
    start = table_start(place_of(file))
    layout = ColumnLayout.of(start.file, start.dialect)
    return {
        one.name: read_columns(layout, column_names(start, one.orientation))
        for one in table_columns(start).units
        if one.orientation
    }


def find_table(listing: Listing) -> list[FileMatch]:
    """Tables of a place that have at least three columns of an inertial unit."""
    found = []
    for one in listing.suffixed(*SUFFIXES):
        try:
            start = table_start(one.path)
            columns = table_columns(start)
        except DataError:
            continue
        names = [unit.name for unit in columns.units]
        shown = ", ".join(names[:_SHOWN_UNITS]) + (" ..." if len(names) > _SHOWN_UNITS else "")
        about = f"table of text, {len(names)} {'unit' if len(names) == 1 else 'units'} by names of columns: {shown}"
        moment = first_moment(start, columns)
        found.append(FileMatch("table", one.path, (one.path,), one.path.stem, about, start=moment))
    return found


def _with_notes(meta: Mapping[str, object], notes: tuple[str, ...]) -> dict[str, object]:
    source = meta["source"]
    assert isinstance(source, Mapping)
    already = source.get("notes", ())
    assert isinstance(already, list | tuple)
    told = [*notes, *already]
    return {**meta, "source": {**source, **({"notes": told} if told else {})}}


def _save_mapping(found: TableMapping, target: Path) -> None:
    folder = target.parent.resolve()
    table = found.start.file.resolve()
    relative = (
        Path(path.relpath(table, folder)).as_posix() if table.drive == folder.drive else table.as_posix()
    )
    lines = ["# The mapping that was used. Change it and read the file with `oarlock import csv`.", ""]
    lines += [f"# {note}" for note in found.notes]
    text = "\n".join([*lines, *found.text(relative).splitlines(), ""])
    write_file(target, text)
