"""Reads CSV exports of APDM (Opal) units: Mobility Lab's "Test Name" layout and Motion Studio's "Format=7".

HDF5 files are passed on to `devices.apdm_hdf5`.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from oarlock.formats.devices.apdm_hdf5 import MAGIC, hdf5_orientations, hdf5_recording
from oarlock.formats.listing import FileMatch, Listing
from oarlock.formats.times import on_one_axis, parsed_stamps, relative_stamps
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import disorder_text
from oarlock.storage.arrays import Floats
from oarlock.storage.delimited import ColumnLayout, Dialect, numbers
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.regular_file import begins_with, open_text
from oarlock.storage.units import plain_unit

# sensor label -> quantity -> position of each column in the file
Sensors: TypeAlias = dict[str, dict[str, list[int]]]

_NEEDED_UNITS = MappingProxyType({"accel_m_s2": "m/s2", "gyro_rad_s": "rad/s", "mag_ut": "uT"})
_QUANTITIES = MappingProxyType(
    {
        "Acceleration": "accel_m_s2",
        "Angular Velocity": "gyro_rad_s",
        "Magnetic Field": "mag_ut",
        "Orientation": "quat_wxyz",
        "Accelerometer": "accel_m_s2",
        "Gyroscope": "gyro_rad_s",
        "Magnetometer": "mag_ut",
    }
)
_COMPONENTS = MappingProxyType({"quat_wxyz": ("S", "X", "Y", "Z")})
_XYZ = ("X", "Y", "Z")


@dataclass(frozen=True)
class _Export:
    """The layout of one file: positions of its columns and its header."""

    layout: ColumnLayout
    sensors: Sensors
    time_unit: str
    meta: dict[str, object]


def read_apdm(path: str | PathLike[str]) -> Recording:
    """Read an APDM export: gyro, accel and mag of every unit.

    Args:
        path: the CSV file. Its "Test Name" layout states its units, which must be s, m/s^2, rad/s and uT;
            "Format=7" states none and is SI by definition, with time in microseconds since 1970. Or an HDF5 file.

    Returns:
        One `ImuStream` per unit, named after its label in lower case with "_" for spaces. Epoch times are shifted to
        start at 0 s; ``meta["clock"]`` has the start time.

    Raises:
        DataError: Another layout or unit, a missing column, or a cell that is not a number, with file and line.
    """
    if begins_with(place_of(path), MAGIC):
        return hdf5_recording(place_of(path))
    export = _open(place_of(path))
    time_s, columns, clock = _read(export, set(_NEEDED_UNITS))
    streams = []
    for label, quantities in export.sensors.items():
        fields = {
            q: np.column_stack([columns[i] for i in quantities[q]]) for q in _NEEDED_UNITS if q in quantities
        }
        if fields:
            streams.append(ImuStream(_stream_name(label), time_s, **fields))
    if not streams:
        raise DataError(f"{path}: no unit has accelerometer, gyroscope or magnetometer columns")
    return Recording(streams, {"source": export.meta, "clock": clock})


def read_apdm_orientations(path: str | PathLike[str]) -> dict[str, Floats]:
    """Read the orientations of the vendor's own filter.

    Args:
        path: the CSV file, as for `read_apdm`; the rows are those of its streams.

    Returns:
        Stream name -> (T, 4) quat_wxyz, earth_from_sensor with the vendor's earth axes: X to magnetic
        north, Z up. Units without orientation are left out.

    Raises:
        DataError: As `read_apdm`.
    """
    if begins_with(place_of(path), MAGIC):
        return hdf5_orientations(place_of(path))
    export = _open(place_of(path))
    _, columns, _ = _read(export, {"quat_wxyz"})
    return {
        _stream_name(label): np.column_stack([columns[i] for i in quantities["quat_wxyz"]])
        for label, quantities in export.sensors.items()
        if "quat_wxyz" in quantities
    }


def _stream_name(label: str) -> str:
    return "_".join(label.lower().split())


def _open(file: Path) -> _Export:
    head = _first_lines(file, 4)
    if head and not head[0]:
        raise DataError(f'{file}:1: is empty; an APDM export begins with "Test Name:" or "Format=7"')
    if head and head[0][0].startswith("Format="):
        return _open_format_7(file, head)
    if head and head[0][0].strip() == "Test Name:":
        return _open_test_name(file, head)
    raise DataError(
        f'{file}:1: is not an APDM export: it begins with "{",".join(head[0])[:40] if head else ""}", '
        'expected "Test Name:" or "Format=7". '
        "For other CSV files write a mapping file and use `oarlock import csv`."
    )


def _first_lines(file: Path, count: int) -> list[list[str]]:
    try:
        with open_text(file, "utf-8-sig") as stream:
            return [row for row, _ in zip(csv.reader(stream), range(count), strict=False)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{file}: is not an APDM export in text form ({error})") from error


def _open_test_name(file: Path, head: list[list[str]]) -> _Export:
    if len(head) < 4 or not head[2] or head[2][0] != "Time":
        raise DataError(
            f'{file}:3: expected the columns\' names, beginning "Time", and their units in line 4'
        )
    sensors: Sensors = {}
    for index, name in enumerate(head[2]):
        label, quantity, component = (*name.split("/"), "", "")[:3]
        if quantity in _QUANTITIES:
            _place(sensors, label, _QUANTITIES[quantity], component.replace("Scalar", "S"), index)
    _check_sensors(file, sensors)
    _check_units(file, head[2], head[3], sensors)
    layout = ColumnLayout(file, Dialect(skip_rows=2, skip_after_header=1), tuple(head[2]), len(head[2]))
    meta: dict[str, object] = {"format": "apdm", "file": file.name, "layout": "Test Name"}
    if len(head[0]) > 1 and head[0][1].strip():
        meta["test"] = head[0][1].strip()
    return _Export(layout, sensors, "s", meta)


def _open_format_7(file: Path, head: list[list[str]]) -> _Export:
    if head[0][0].strip() != "Format=7":
        raise DataError(f'{file}:1: "{head[0][0]}" is not supported. Export it as Format=7.')
    if len(head) < 3 or len({len(row) for row in head[:3]}) != 1 or head[1][0] != "Time":
        raise DataError(f'{file}: expected three header lines of one length, the second beginning "Time"')
    sensors: Sensors = {}
    label = quantity = ""
    # The line of labels contains a unit's number over its first column and its name three columns later.
    starts = {i for i, cell in enumerate(head[0]) if i > 0 and cell.strip().isdigit()}
    for index in range(1, len(head[0])):
        if index in starts:
            label = next(
                (c.strip() for c in head[0][index + 1 : index + 14] if c.strip()), head[0][index].strip()
            )
        quantity = head[1][index].strip() or quantity
        if quantity in _QUANTITIES:
            _place(sensors, label, _QUANTITIES[quantity], head[2][index].strip(), index)
    _check_sensors(file, sensors)
    names = _names_format_7(sensors, len(head[0]))
    layout = ColumnLayout(file, Dialect(skip_rows=2), names, len(names))
    return _Export(layout, sensors, "epoch_us", {"format": "apdm", "file": file.name, "layout": "Format=7"})


def _names_format_7(sensors: Sensors, width: int) -> tuple[str, ...]:
    """Names of the columns for errors: the file spreads them over three lines."""
    names = ["Time"] + [f"column {i + 1}" for i in range(1, width)]
    for label, quantities in sensors.items():
        for quantity, indices in quantities.items():
            for component, index in zip(_COMPONENTS.get(quantity, _XYZ), indices, strict=True):
                names[index] = f"{label} {quantity} {component}"
    return tuple(names)


def _place(sensors: Sensors, label: str, quantity: str, component: str, index: int) -> None:
    components = _COMPONENTS.get(quantity, _XYZ)
    if component in components:
        places = sensors.setdefault(label, {}).setdefault(quantity, [-1] * len(components))
        places[components.index(component)] = index


def _check_sensors(file: Path, sensors: Sensors) -> None:
    if not sensors:
        raise DataError(f"{file}: its header names no accelerometer, gyroscope, magnetometer or orientation")
    names: dict[str, str] = {}
    for label, quantities in sensors.items():
        for quantity, places in quantities.items():
            for component, place in zip(_COMPONENTS.get(quantity, _XYZ), places, strict=True):
                if place < 0:
                    raise DataError(f'{file}: unit "{label}" has no column for {quantity} {component}')
        if (name := _stream_name(label)) in names:
            raise DataError(f'{file}: the units "{names[name]}" and "{label}" would both be named "{name}"')
        names[name] = label


def _check_units(file: Path, names: Sequence[str], units: Sequence[str], sensors: Sensors) -> None:
    needed = {0: "s"} | {
        i: _NEEDED_UNITS[q]
        for quantities in sensors.values()
        for q in _NEEDED_UNITS
        for i in quantities.get(q, [])
    }
    for index, unit in needed.items():
        found = units[index] if index < len(units) else ""
        if plain_unit(found) != unit:
            raise DataError(
                f'{file}:4, column "{names[index]}": the unit is "{found}", expected "{unit}". '
                "Export in SI units, or write a mapping file and use `oarlock import csv`."
            )


def _read(export: _Export, quantities: set[str]) -> tuple[Floats, dict[int, Floats], dict[str, object]]:
    """Time stamps in s, the columns of these quantities by position, and the note on the clock."""
    layout = export.layout
    wanted = [0, *(i for s in export.sensors.values() for q in sorted(quantities & s.keys()) for i in s[q])]
    parts: list[list[Floats]] = [[] for _ in wanted]
    lines: list[int] = []
    stamps: list[str] = []
    for batch in layout.batches(wanted):
        lines += batch.lines
        stamps += batch.cells[0]
        for position, index in enumerate(wanted):
            parts[position].append(numbers(layout, batch, position, index))
    if not lines:
        raise DataError(f"{layout.file}: has a header but no rows of data")
    columns = {i: np.concatenate(p) for i, p in zip(wanted, parts, strict=True)}
    places = [f"{layout.file}:{n}, {layout.label(0)}" for n in lines]
    axis = (
        relative_stamps(columns[0], "s")
        if export.time_unit == "s"
        else parsed_stamps(stamps, places, export.time_unit)
    )
    (time_s,), clock = on_one_axis([axis], [str(layout.file)])
    _check_stamps(time_s, places)
    return time_s, columns, clock


def _check_stamps(time_s: Floats, places: list[str]) -> None:
    bad = np.flatnonzero(np.isnan(time_s))
    if bad.size:
        raise DataError(f"{places[bad[0]]}: the time is missing ({bad.size} of {time_s.size} rows)")
    late = np.flatnonzero(np.diff(time_s) <= 0.0)
    if late.size:
        index = int(late[0]) + 1
        raise DataError(f"{places[index]}: time_s{disorder_text(time_s, index)}")


def find_apdm(listing: Listing) -> list[FileMatch]:
    """Exports among the .csv files of a place, and HDF5 files that have sensors."""
    found = [
        FileMatch("apdm", one.path, (one.path,), one.path.stem, "APDM (Opal), HDF5")
        for one in listing.files
        if one.head.startswith(MAGIC) and b"Sensors\0" in one.head
    ]
    for one in listing.suffixed(".csv"):
        first = one.lines[0] if one.lines else ""
        is_format_7 = first.startswith("Format=") and len(one.lines) > 1 and one.lines[1].startswith("Time,")
        if is_format_7 or first.startswith("Test Name:"):
            found.append(FileMatch("apdm", one.path, (one.path,), one.path.stem, "APDM (Opal) export"))
    return found
