"""Reads CSV files of Movella DOT (Xsens DOT), as its app and its software kit write them: one file per unit.

Columns and lines above them as in the log writer of the app; units, wraps and angles (R = Rz Ry Rx) as in the user
manual (XD0502P, section 4.2: m/s2, deg/s, arbitrary units, SampleTimeFine in us); bits of Status as in the BLE
specification (XD0506P). No file of the maker was at hand: the tests read files made from these documents.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from types import MappingProxyType

import numpy as np

from oarlock.formats.devices.exported_table import (
    Columns,
    ExportedTable,
    Header,
    exported_table,
    found_header,
    read_columns_of,
)
from oarlock.formats.devices.mtmanager import ACCEL, DOT_ONLY, GYRO, MAG, MT_ONLY
from oarlock.formats.devices.sample_clock import COUNTER, TICKS, SampleClock, clock_note
from oarlock.formats.devices.trials import Trial, trial_at
from oarlock.formats.devices.unit_readings import (
    UnitReadings,
    check_quaternions,
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
from oarlock.storage.units import to_held_unit

_QUAT = tuple(f"Quat_{axis}" for axis in "WXYZ")
_EULER = tuple(f"Euler_{axis}" for axis in "XYZ")
_GROUPS = (ACCEL, GYRO, MAG, _QUAT, _EULER)
_STATUS = "Status"
_READ = frozenset((COUNTER, TICKS, _STATUS, *(name for group in _GROUPS for name in group)))
_CLOCK = SampleClock(
    2.0**32,
    2.0**32,
    1e6,
    "gives an OutputRate. Export with SampleTimeFine, or write the line OutputRate:,60Hz.",
)
OUT_OF_RANGE = tuple(f"{kind}_{axis}" for kind in ("accel", "gyro", "mag") for axis in "xyz")
"""Of bits 0 to 8 of `Status`."""
_SAID = MappingProxyType(
    {
        "DeviceTag": "device",
        "FirmwareVersion": "firmware",
        "AppVersion": "software",
        "SyncStatus": "sync",
        "OutputRate": "rate",
        "FilterProfile": "filter",
        "Measurement Mode": "mode",
        "StartTime": "start",
    }
)
_STEM = re.compile(r"(?P<label>.+?)_(?P<date>\d{8})_(?P<time>\d{6})(_\d{3})?", re.ASCII)
_SAME_TRIAL = datetime.timedelta(seconds=10)
"""The app names the files of one start one after the other; nobody starts two trials so quickly."""
_RATE = re.compile(r"(\d+(?:\.\d+)?)\s*hz", re.IGNORECASE)


@dataclass(frozen=True)
class _DotFile:
    """One file: its table, what its head says, and the columns that are read."""

    table: ExportedTable
    said: dict[str, str]
    name: str
    columns: Columns

    def has(self, names: Sequence[str]) -> bool:
        return self.table.present(names)

    def fields(self) -> dict[str, Floats]:
        fields = {}
        if self.has(ACCEL):
            fields["accel_m_s2"] = self.columns.rows(ACCEL)
        if self.has(GYRO):
            fields["gyro_rad_s"] = to_held_unit(self.columns.rows(GYRO), "deg/s")
        if self.has(MAG):
            fields["mag_arbitrary"] = self.columns.rows(MAG)
        if self.has(_QUAT):
            fields["quat_wxyz"] = check_quaternions(self.columns.rows(_QUAT), self.columns.places(_QUAT[0]))
        elif self.has(_EULER):
            fields["quat_wxyz"] = quat_from_roll_pitch_yaw(self.columns.rows(_EULER))
        return fields

    def rate_hz(self) -> float | None:
        rate = _RATE.search(self.said.get("rate", ""))
        return None if rate is None else float(rate[1])

    def out_of_range(self) -> dict[str, int]:
        """Number of rows in which an axis was beyond its range, by the flags of the unit."""
        if _STATUS not in self.columns.values:
            return {}
        status = self.columns.values[_STATUS]
        places = self.columns.places(_STATUS)
        odd = np.flatnonzero(
            np.isfinite(status) & ((status < 0.0) | (status >= 2.0**16) | (status % 1.0 != 0.0))
        )
        if odd.size:
            raise DataError(
                f"{places[odd[0]]}: is {status[odd[0]]:.15g}; expected flags, a whole number of 16 bit"
            )
        flags = np.nan_to_num(status).astype(np.int64)
        counts = {name: int(((flags >> bit) & 1).sum()) for bit, name in enumerate(OUT_OF_RANGE)}
        return {name: count for name, count in counts.items() if count}


def read_dot(path: str | PathLike[str], trial: str | None = None, orientations: bool = False) -> Recording:
    """Read CSV files of Movella DOT: one file, or all synchronised units of a trial.

    Args:
        path: a file, or a folder with a file for each unit, `TAG_20250711_200600_086.csv`.
        trial: which trial, if the folder has several: what the files' names share.
        orientations: also read the orientations that units with a gyroscope computed, as streams `NAME_orientation`.

    Returns:
        An `ImuStream` per unit, named after its tag in lower case. Without a gyroscope, the unit's own orientation is
        an `OrientationStream`. The magnetometer is in arbitrary units: see `arbitrary_units`. Free acceleration and
        increments (`dq`, `dv`) are not read. ``meta["source"]["units"]`` counts readings beyond the range, by `Status`.

    Raises:
        DataError: Another layout, a cell that is not a number; names file, line and column.
    """
    chosen = trial_at(place_of(path), trial, _trials, "CSV files of Movella DOT")
    units = [_unit(one) for one in chosen.files]
    columns = [unit.columns for unit in units]
    stamped = _CLOCK.stamped(columns, [unit.rate_hz() for unit in units])
    readings = [
        UnitReadings(unit.name, one.time_s, **unit.fields(), lost=one.lost)
        for unit, one in zip(units, stamped, strict=True)
    ]
    beyond = {unit.name: unit.out_of_range() for unit in units}
    said = {u.name: u.said | ({"out_of_range": beyond[u.name]} if beyond[u.name] else {}) for u in units}
    source = source_of("dot", chosen.name, [unit.table for unit in units], said, _READ)
    return recording_of(readings, source, clock_note(columns), orientations, _notes(beyond))


def find_dot(listing: Listing) -> list[FileMatch]:
    """The trials among the .csv and .txt files of a place: synchronised units together, others alone."""
    found = []
    for trial in _trials(listing):
        count = len(trial.files)
        about = f"Movella DOT, {count} synchronised units" if count > 1 else "Movella DOT, 1 unit"
        found.append(trial.found("dot", about))
    return found


def _trials(listing: Listing) -> list[Trial]:
    trials: list[tuple[datetime.datetime | None, set[str], list[ListedFile]]] = []
    for one in listing.suffixed(".csv", ".txt"):
        header = _header(one)
        if header is None:
            continue
        label, moment = _label_and_moment(one)
        synced = _said(one.lines[: header.row], header.separator).get("sync", "").lower() == "synced"
        for began, labels, files in trials:
            if not synced or moment is None or began is None or files[0].path.parent != one.path.parent:
                continue
            if abs(moment - began) <= _SAME_TRIAL and label not in labels:
                labels.add(label)
                files.append(one)
                break
        else:
            trials.append((moment if synced else None, {label}, [one]))
    return [Trial(files[0].path.parent, _trial_name(files), tuple(files)) for _, _, files in trials]


def _trial_name(files: Sequence[ListedFile]) -> str:
    stem = files[0].path.stem
    parts = _STEM.fullmatch(stem)
    return stem if len(files) == 1 or parts is None else stem[parts.start("date") :]


def _label_and_moment(one: ListedFile) -> tuple[str, datetime.datetime | None]:
    parts = _STEM.fullmatch(one.path.stem)
    if parts is None:
        return one.path.stem, None
    try:
        return parts["label"], datetime.datetime.strptime(parts["date"] + parts["time"], "%Y%m%d%H%M%S")
    except ValueError:
        return parts["label"], None


def _header(one: ListedFile) -> Header | None:
    """The line of names; None if this is no file of a DOT."""
    header = found_header(one.lines, COUNTER, lambda names: COUNTER in names)
    if header is None or MT_ONLY & set(header.names):
        return None
    above = one.lines[: header.row]
    if any(line.lstrip().startswith("//") for line in above):
        return None
    if "device" in _said(above, header.separator) or DOT_ONLY & set(header.names):
        return header
    return header if set(ACCEL) & set(header.names) else None


def _said(lines: Sequence[str], separator: str) -> dict[str, str]:
    """What the lines above the names say, by our words."""
    said = {}
    for line in lines:
        cells = [cell.strip() for cell in line.split(separator)]
        word = _SAID.get(cells[0].rstrip(": "))
        if word and len(cells) > 1 and cells[1]:
            said[word] = cells[1]
    return said


def _unit(one: ListedFile) -> _DotFile:
    header = _header(one)
    if header is None:
        raise DataError(
            f"{one.path}: is not a CSV file of Movella DOT: no line names the columns {COUNTER}, {TICKS} and readings "
            "such as Acc_X or Quat_W. Export it as CSV with the app."
        )
    table = exported_table(one, header)
    groups = [group for group in _GROUPS if table.present(group)]
    if not groups:
        raise DataError(
            f"{one.path}:{header.row + 1}: names no Acc, Gyr, Mag, Quat or Euler columns. Free acceleration and "
            "increments (dq, dv) are not read: export rate quantities or orientations."
        )
    others = [name for name in (COUNTER, TICKS, _STATUS) if name in table.layout.names]
    said = _said(table.above, header.separator)
    name = stream_name(said.get("device", "")) or stream_name(_label_and_moment(one)[0]) or "unit"
    columns = read_columns_of(table, [*others, *(name for group in groups for name in group)])
    return _DotFile(table, said, name, columns)


def _notes(beyond: dict[str, dict[str, int]]) -> list[str]:
    return [
        f"{name}: readings beyond the unit's range, by its own flags: "
        + ", ".join(f"{axis} in {count} {'row' if count == 1 else 'rows'}" for axis, count in counts.items())
        + ". They are imported as they stand."
        for name, counts in beyond.items()
        if counts
    ]
