"""Reads tables of orientations of OpenSim (`.sto` with DataType=Quaternion), as OpenSense writes and reads them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from os import PathLike

import numpy as np

from oarlock.formats.devices.exported_table import (
    ExportedTable,
    Header,
    exported_table,
    found_header,
    read_columns_of,
    single_file,
)
from oarlock.formats.devices.unit_readings import UnitReadings, check_quaternions, recording_of, source_of
from oarlock.formats.listing import FileMatch, ListedFile, Listing
from oarlock.model.rotation import quat_product
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

_TIME = "time"
_END = "endheader"
_UPS = ("z", "y")
_Z_UP_FROM_Y_UP = np.array([[math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0]])
"""A quarter of a turn about x, which takes y to z."""


def read_sto(path: str | PathLike[str], up: str = "z") -> Recording:
    """Read a table of orientations of OpenSim.

    Args:
        path: the `.sto` file.
        up: axis of the file's reference that points up: z (inertial units) or y (OpenSim's ground). The file does not
            say; y is turned to z.

    Returns:
        One `OrientationStream` per column, with its name. Time stamps are unchanged.

    Raises:
        DataError: Another table, a cell that is not w,x,y,z; names file, line and column.
    """
    if up not in _UPS:
        raise DataError(f'up is "{up}"; expected z or y')
    one = single_file(place_of(path))
    header = _header(one)
    if header is None:
        raise DataError(
            f"{one.path}: is not a table of orientations of OpenSim: it needs the lines DataType=Quaternion and "
            f'"{_END}", and then names that begin with "{_TIME}"'
        )
    table = exported_table(one, header)
    labels = [name for name in table.layout.names if name not in (_TIME, "")]
    columns = read_columns_of(table, [_TIME], labels)
    time_s = columns.present(_TIME, "time")
    columns.check_increasing(time_s, _TIME)
    units = []
    for label in labels:
        quat = _quaternions(columns.texts[label], columns.places(label))
        if up == "y":
            quat = quat_product(np.broadcast_to(_Z_UP_FROM_Y_UP, quat.shape), quat)
        units.append(UnitReadings(label, time_s, quat_wxyz=quat))
    source = source_of("sto", one.path.stem, [table], _said(table), {_TIME, *labels})
    return recording_of(units, source | {"up": up}, {"kind": "relative"}, True)


def find_sto(listing: Listing) -> list[FileMatch]:
    """The tables of orientations among the `.sto` files of a place."""
    found = []
    for one in listing.suffixed(".sto"):
        if (header := _header(one)) is not None:
            count = len([name for name in header.names if name]) - 1
            about = f"OpenSim orientations, {count} {'sensor' if count == 1 else 'sensors'}"
            found.append(FileMatch("sto", one.path, (one.path,), one.path.stem, about))
    return found


def _header(one: ListedFile) -> Header | None:
    lines = [line.strip() for line in one.lines]
    if _END not in lines:
        return None
    end = lines.index(_END)
    if not any(line.replace(" ", "").lower() == "datatype=quaternion" for line in lines[:end]):
        return None
    header = found_header(one.lines[end + 1 :], _TIME, lambda names: names[0] == _TIME)
    return None if header is None else Header(header.row + end + 1, header.separator, header.names)


def _said(table: ExportedTable) -> dict[str, dict[str, object]]:
    pairs = (line.partition("=") for line in table.above)
    return {"header": {key.strip(): value.strip() for key, mark, value in pairs if mark and key.strip()}}


def _quaternions(cells: Sequence[str], places: Sequence[str]) -> Floats:
    quat = np.full((len(cells), 4), np.nan)
    for row, cell in enumerate(cells):
        parts = cell.split(",")
        try:
            if len(parts) != 4 or "_" in cell:
                raise ValueError
            quat[row] = [float(part) for part in parts]
        except ValueError:
            raise DataError(f'{places[row]}: "{cell[:60]}" is no quaternion w,x,y,z') from None
    return check_quaternions(quat, places)
