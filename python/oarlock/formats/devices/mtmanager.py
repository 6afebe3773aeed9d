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

from oarlock.formats.devices.exported_table import (
    Columns,
    ExportedTable,
    Header,
    exported_table,
    found_header,
    read_columns_of,
)
from oarlock.formats.devices.sample_clock import COUNTER, TICKS, SampleClock, clock_note
from oarlock.formats.devices.trials import Trial, trial_at
from oarlock.formats.devices.unit_readings import (
    UnitReadings,
    check_quaternions,
    quat_from_matrices,
    quat_from_roll_pitch_yaw,
    recording_of,
    source_of,
    stream_name,
)
from oarlock.formats.listing import FileMatch, ListedFile, Listing
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

ACCEL, GYRO, MAG = (tuple(f"{kind}_{axis}" for axis in "XYZ") for kind in ("Acc", "Gyr", "Mag"))
_QUAT = tuple(f"Quat_q{k}" for k in range(4))
# Stored column by column.
_MATRIX = tuple(f"Mat[{row}][{column}]" for column in (1, 2, 3) for row in (1, 2, 3))
_ANGLES = ("Roll", "Pitch", "Yaw")
_FIELDS = MappingProxyType({"accel_m_s2": ACCEL, "gyro_rad_s": GYRO, "mag_arbitrary": MAG})
_READ = frozenset((COUNTER, TICKS, *ACCEL, *GYRO, *MAG, *_QUAT, *_MATRIX, *_ANGLES))
MT_ONLY = frozenset((*_QUAT, *_MATRIX, *_ANGLES, "VelInc_X", "OriInc_q0", "OriInc_w"))
"""Columns of MT Manager alone."""
DOT_ONLY = frozenset(("Quat_W", "Euler_X", "dq_W", "dv[1]"))
"""Columns of Movella DOT, whose exports begin with the same names."""
_CLOCK = SampleClock(
    2.0**16,
    2.0**32,
    1e4,
    "gives an Update Rate; PacketCounter has no rate. Give the rate that was set in MT Manager, usually "
    "100, 60, 120, 80 or 40 Hz: oarlock import mtmanager PATH --rate-hz 100.",
    "rate_hz",
)
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
class _MtManagerFile:
    """One file: its table, what its head says, and the columns that are read."""

    table: ExportedTable
    said: dict[str, str]
    rate_hz: float | None
    name: str
    columns: Columns
    doubled: int

    def has(self, names: Sequence[str]) -> bool:
        return self.table.present(names)

    def quat_wxyz(self) -> Floats | None:
        if self.said.get("coordinate_system", "ENU") not in _Z_UP:
            return None
        if self.has(_QUAT):
            return check_quaternions(self.columns.rows(_QUAT), self.columns.places(_QUAT[0]))
        if self.has(_MATRIX):
            matrices = self.columns.rows(_MATRIX).reshape(-1, 3, 3).transpose(0, 2, 1)
            return quat_from_matrices(matrices, self.columns.places(_MATRIX[0]))
        return quat_from_roll_pitch_yaw(self.columns.rows(_ANGLES)) if self.has(_ANGLES) else None


def read_mtmanager(
    path: str | PathLike[str],
    trial: str | None = None,
    rate_hz: float | None = None,
    orientations: bool = False,
) -> Recording:
    """Read an export of MT Manager: one file, or all units of a trial.

    Args:
        path: a file, or a folder with a file for each unit, `TRIAL_00B421AF.txt`.
        trial: which trial, if the folder has several: what the files' names share.
        rate_hz: rate of the packet counter, Hz, of files without SampleTimeFine and without "Update Rate".
        orientations: also read the orientations that units with a gyroscope computed, as streams `NAME_orientation`.

    Returns:
        An `ImuStream` per unit, named after its device number in lower case. Without a gyroscope, the unit's own
        orientation is an `OrientationStream`. The magnetometer is in arbitrary units: see `arbitrary_units`.
        Time stamps are SampleTimeFine where it is filled, else the packet counter divided by the rate.

    Raises:
        DataError: Another layout, a cell that is not a number; names file, line and column.
        UnclearError: The rate is not known.
    """
    chosen = trial_at(place_of(path), trial, _trials, "exports of MT Manager")
    units = [_unit(one) for one in chosen.files]
    columns = [unit.columns for unit in units]
    rates_hz = [_rate_hz(unit, rate_hz) for unit in units]
    readings = [
        UnitReadings(
            unit.name,
            stamped.time_s,
            **{field: unit.columns.rows(names) for field, names in _FIELDS.items() if unit.has(names)},
            quat_wxyz=unit.quat_wxyz(),
            lost=stamped.lost,
        )
        for unit, stamped in zip(units, _CLOCK.stamped(columns, rates_hz), strict=True)
    ]
    said = {unit.name: unit.said | _stated(unit.rate_hz) for unit in units}
    source = source_of("mtmanager", chosen.name, [unit.table for unit in units], said, _READ)
    return recording_of(readings, source, clock_note(columns), orientations, _notes(units))


def _rate_hz(unit: _MtManagerFile, given: float | None) -> float | None:
    if given is not None and unit.rate_hz is not None and given != unit.rate_hz:
        raise DataError(
            f"{unit.table.file}: its Update Rate is {unit.rate_hz:g} Hz, but the rate given is {given:g} Hz. "
            "Leave it out."
        )
    return given if unit.rate_hz is None else unit.rate_hz


def _stated(rate_hz: float | None) -> dict[str, object]:
    return {} if rate_hz is None else {"rate_hz": rate_hz}


def find_mtmanager(listing: Listing) -> list[FileMatch]:
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
    header = found_header(one.lines, COUNTER, lambda names: COUNTER in names)
    if header is None or DOT_ONLY & set(header.names):
        return None
    above = [line for line in one.lines[: header.row] if line.strip()]
    if any(not line.lstrip().startswith("//") for line in above):
        return None
    return header if above or MT_ONLY & set(header.names) or set(ACCEL) & set(header.names) else None


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


def _unit(one: ListedFile) -> _MtManagerFile:
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
    written = read_columns_of(table, [*clocks, *(name for group in groups for name in group)])
    columns = written.once()
    rate = next((found for line in table.above if (found := _RATE.search(line))), None)
    rate_hz = float(rate[1]) if rate is not None and float(rate[1]) > 0.0 else None
    name = stream_name(_trial_and_device(one)[1])
    doubled = len(written.lines) - len(columns.lines)
    return _MtManagerFile(table, _said(table.above), rate_hz, name or "unit", columns, doubled)


def _notes(units: Sequence[_MtManagerFile]) -> list[str]:
    twice = [
        f"{unit.name}: packets that the file has twice: {unit.doubled}; each was read once."
        for unit in units
        if unit.doubled
    ]
    return twice + [
        f'{unit.name}: the orientation was left out, because its axes are "{unit.said["coordinate_system"]}"; '
        "export with ENU axes."
        for unit in units
        if unit.said.get("coordinate_system", "ENU") not in _Z_UP
    ]
