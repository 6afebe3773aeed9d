"""Reads text exports of Xsens MT Manager (MTw, MTi): one file per unit, tab, comma, semicolon or space between fields.

Units and wraps as in the MTw user manual (acceleration m/s2, angular rate rad/s, magnetic field in arbitrary units,
counter of 16 bit, SampleTimeFine in 0.1 ms). Matrices, quaternions and roll, pitch, yaw take the sensor's axes to the
earth's: R = Rz(yaw) Ry(pitch) Rx(roll) (MTi user manual, orientation output modes).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from types import MappingProxyType

import numpy as np

from oarlock.formats.counters import lost_packets, unwrapped
from oarlock.formats.devices.exported_table import (
    Columns,
    ExportedTable,
    Header,
    exported_table,
    found_header,
    read_columns_of,
)
from oarlock.formats.devices.trials import Trial, trial_at
from oarlock.formats.devices.unit_readings import (
    UnitReadings,
    quat_from_matrices,
    quat_from_roll_pitch_yaw,
    recording_of,
    stream_name,
)
from oarlock.formats.listing import Found, ListedFile, Listing
from oarlock.recording.recording import Recording
from oarlock.storage.array_gate import FloatArray
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

COUNTER, TICKS = "PacketCounter", "SampleTimeFine"
COUNTER_WRAPS_AT, TICKS_WRAP_AT = 2.0**16, 2.0**32
TICK_RATE_HZ = 1e4
ACCEL, GYRO, MAG = (tuple(f"{kind}_{axis}" for axis in "XYZ") for kind in ("Acc", "Gyr", "Mag"))
_QUAT = tuple(f"Quat_q{k}" for k in range(4))
# Stored column by column.
_MATRIX = tuple(f"Mat[{row}][{column}]" for column in (1, 2, 3) for row in (1, 2, 3))
_ANGLES = ("Roll", "Pitch", "Yaw")
_OWN = frozenset((*_QUAT, *_MATRIX, *_ANGLES, "VelInc_X", "OriInc_q0", "OriInc_w"))
DOT_ONLY = frozenset(("Quat_W", "Euler_X", "dq_W", "dv[1]"))
"""Columns of Movella DOT, whose exports begin with the same names."""
_Z_UP = frozenset(("ENU", "NWU"))
_STEM = re.compile(r"(?P<trial>.*?)[_-]?(?P<device>[0-9A-Fa-f]{8})")
_RATE = re.compile(r"update rate:\s*(\d+(?:\.\d+)?)\s*hz", re.IGNORECASE)
_SAID = MappingProxyType(
    {
        "deviceid": "device",
        "productcode": "product",
        "firmware version": "firmware",
        "hardware version": "hardware",
        "mt manager version": "software",
        "filter profile": "filter",
        "coordinate system": "coordinate_system",
    }
)


@dataclass(frozen=True)
class _Unit:
    """One file: its table, what its head says, and the columns that are read."""

    table: ExportedTable
    said: dict[str, str]
    rate_hz: float | None
    name: str
    columns: Columns

    def has(self, names: Sequence[str]) -> bool:
        return self.table.present(names)

    def quat_wxyz(self) -> FloatArray | None:
        if self.said.get("coordinate_system", "ENU") not in _Z_UP:
            return None
        if self.has(_QUAT):
            return self.columns.rows(_QUAT)
        if self.has(_MATRIX):
            matrices = self.columns.rows(_MATRIX).reshape(-1, 3, 3).transpose(0, 2, 1)
            return quat_from_matrices(matrices, self.columns.places(_MATRIX[0]))
        return quat_from_roll_pitch_yaw(self.columns.rows(_ANGLES)) if self.has(_ANGLES) else None

    def count(self) -> FloatArray:
        return unwrapped(
            self.columns.present(COUNTER, "counter"), COUNTER_WRAPS_AT, self.columns.places(COUNTER)
        )

    def has_ticks(self) -> bool:
        return TICKS in self.columns.values and bool(np.isfinite(self.columns.values[TICKS]).any())


def read_mtmanager(
    path: str | PathLike[str],
    trial: str | None = None,
    rate_hz: float | None = None,
    orientations: bool = False,
) -> Recording:
    """Read an export of MT Manager: one file, or all units of a trial.

    Args:
        path: a file, or a folder with a file for each unit, `TRIAL_00B421AF.txt`.
        trial: which trial, if the folder has several: what the names have in common.
        rate_hz: rate of the packet counter; only for files without SampleTimeFine and without "Update Rate".
        orientations: also read the orientations of units that have a gyroscope, as streams `NAME_orientation`.

    Returns:
        An `ImuStream` per unit, named after its device number in lower case. Without a gyroscope, the unit's own
        orientation is an `OrientationStream`. The magnetometer is in arbitrary units: see `arbitrary_units`.
        Time stamps are SampleTimeFine where it is filled, else the packet counter divided by the rate.

    Raises:
        DataError: Another layout, a cell that is not a number, no rate; names file, line and column.
    """
    chosen = trial_at(place_of(path), trial, _trials, "exports of MT Manager")
    units = [_unit(one) for one in chosen.files]
    times = _times(units, rate_hz)
    readings = []
    for unit, (time_s, count) in zip(units, times, strict=True):
        fields = {
            field: unit.columns.rows(names)
            for field, names in (("accel_m_s2", ACCEL), ("gyro_rad_s", GYRO), ("mag_arbitrary", MAG))
            if unit.has(names)
        }
        lost = lost_packets(count, time_s, unit.columns.places(COUNTER))
        readings.append(UnitReadings(unit.name, time_s, **fields, quat_wxyz=unit.quat_wxyz(), lost=lost))
    by_ticks = units[0].has_ticks()
    clock = {"kind": "relative" if by_ticks else "samples", "from": TICKS if by_ticks else COUNTER}
    return recording_of(readings, _source(chosen, units), clock, orientations, _notes(units))


def find_mtmanager(listing: Listing) -> list[Found]:
    """The trials among the .txt and .csv files of a place."""
    found = []
    for trial in _trials(listing):
        count = len(trial.files)
        about = f"Xsens MT Manager, {count} {'unit' if count == 1 else 'units'}"
        if not all(_has_rate(one) for one in trial.files):
            about += ", rate not stated: give --rate-hz"
        found.append(trial.found("mtmanager", about))
    return found


def _trials(listing: Listing) -> list[Trial]:
    groups: dict[tuple[str, str], list[ListedFile]] = {}
    for one in listing.suffixed(".txt", ".csv"):
        if _header(one) is not None:
            groups.setdefault((str(one.path.parent), _trial_and_device(one)[0]), []).append(one)
    return [Trial(files[0].path.parent, name, tuple(files)) for (_, name), files in groups.items()]


def _header(one: ListedFile) -> Header | None:
    """The line of names; None if this is no export of MT Manager."""
    header = found_header(one.lines, lambda names: COUNTER in names)
    if header is None or DOT_ONLY & set(header.names):
        return None
    above = [line for line in one.lines[: header.row] if line.strip()]
    if any(not line.lstrip().startswith("//") for line in above):
        return None
    return header if above or _OWN & set(header.names) or set(ACCEL) & set(header.names) else None


def _trial_and_device(one: ListedFile) -> tuple[str, str]:
    stem = one.path.stem
    parts = _STEM.fullmatch(stem)
    if parts is None or not parts["trial"]:
        return stem, _said(one.lines).get("device", stem)
    return parts["trial"], parts["device"]


def _said(lines: Sequence[str]) -> dict[str, str]:
    """What the lines above the names say, by our words."""
    said: dict[str, str] = {}
    for line in lines:
        key, _, value = line.strip().lstrip("/").partition(":")
        if (word := _SAID.get(key.strip().lower())) and line.lstrip().startswith("//") and value.strip():
            said[word] = value.strip()
    return said


def _has_rate(one: ListedFile) -> bool:
    if any(_RATE.search(line) for line in one.lines if line.lstrip().startswith("//")):
        return True
    header = _header(one)
    if header is None or TICKS not in header.names:
        return False
    first = next((line for line in one.lines[header.row + 1 :] if line.strip()), "").split(header.separator)
    place = header.names.index(TICKS)
    return place < len(first) and first[place].strip().replace(".", "").isdigit()


def _unit(one: ListedFile) -> _Unit:
    header = _header(one)
    if header is None:
        raise DataError(
            f"{one.path}: is not an export of MT Manager: no line names the columns, beginning with {COUNTER}, below "
            'lines that begin with "//". Export from MT Manager as text.'
        )
    table = exported_table(one, header)
    groups = [group for group in (ACCEL, GYRO, MAG, _QUAT, _MATRIX, _ANGLES) if table.present(group)]
    if not groups:
        raise DataError(
            f"{one.path}:{header.row + 1}: names no Acc, Gyr, Mag, Quat, Mat or Roll columns. In MT Manager, choose "
            "calibrated inertial data or orientation for the export."
        )
    clocks = [name for name in (COUNTER, TICKS) if name in table.layout.names]
    columns = read_columns_of(table, [*clocks, *(name for group in groups for name in group)])
    rate = next((found for line in table.above if (found := _RATE.search(line))), None)
    rate_hz = float(rate[1]) if rate is not None and float(rate[1]) > 0.0 else None
    name = stream_name(_trial_and_device(one)[1])
    return _Unit(table, _said(table.above), rate_hz, name or "unit", columns)


def _times(units: Sequence[_Unit], rate_hz: float | None) -> list[tuple[FloatArray, FloatArray]]:
    """Time stamps in s and unwrapped packet counts of each unit, on one axis."""
    counts = _aligned([unit.count() for unit in units], COUNTER_WRAPS_AT)
    with_ticks = [unit.has_ticks() for unit in units]
    if any(with_ticks) != all(with_ticks):
        raise DataError(
            f"{units[with_ticks.index(False)].table.file}: {TICKS} is empty, that of "
            f"{units[with_ticks.index(True)].table.file.name} is filled. They have no common clock; import them alone."
        )
    if not all(with_ticks):
        zero = min(float(count[0]) for count in counts)
        rates = [_rate_hz(unit, rate_hz) for unit in units]
        return [((count - zero) / rate, count) for count, rate in zip(counts, rates, strict=True)]
    ticks = [
        unwrapped(unit.columns.present(TICKS, "time"), TICKS_WRAP_AT, unit.columns.places(TICKS))
        for unit in units
    ]
    times = [tick / TICK_RATE_HZ for tick in _aligned(ticks, TICKS_WRAP_AT)]
    for unit, time_s in zip(units, times, strict=True):
        unit.columns.check_increasing(time_s, TICKS)
    return list(zip(times, counts, strict=True))


def _aligned(counts: Sequence[FloatArray], wraps_at: float) -> list[FloatArray]:
    """Counts of one clock that began near each other, possibly on both sides of a wrap."""
    first = float(counts[0][0])
    return [count - wraps_at * round((float(count[0]) - first) / wraps_at) for count in counts]


def _rate_hz(unit: _Unit, given: float | None) -> float:
    rate_hz = unit.rate_hz if unit.rate_hz is not None else given
    if rate_hz is None or not 0.0 < rate_hz < float("inf"):
        raise DataError(
            f"{unit.table.file}: the time is not known: {TICKS} is empty and no line above the names gives an "
            "Update Rate. Give the rate of the recording with --rate-hz, such as --rate-hz 100."
        )
    return rate_hz


def _source(trial: Trial, units: Sequence[_Unit]) -> dict[str, object]:
    read = {COUNTER, TICKS, *ACCEL, *GYRO, *MAG, *_QUAT, *_MATRIX, *_ANGLES, ""}
    names = dict.fromkeys(name for unit in units for name in unit.table.layout.names if name not in read)
    rates = {unit.name: {"rate_hz": unit.rate_hz} if unit.rate_hz is not None else {} for unit in units}
    return {
        "format": "mtmanager",
        "files": [unit.table.file.name for unit in units],
        "trial": trial.name,
        "units": {unit.name: unit.said | rates[unit.name] for unit in units},
        "left_out": list(names),
    }


def _notes(units: Sequence[_Unit]) -> list[str]:
    return [
        f'{unit.name}: the orientation was left out, because its axes are "{unit.said["coordinate_system"]}"; '
        "export with ENU axes."
        for unit in units
        if unit.said.get("coordinate_system", "ENU") not in _Z_UP
    ]
