"""Reads CSV exports of Shimmer Consensys: a line "sep=", a line of names, a line of units; one or several units a file.

Names are UNIT_Accel_LN_X_CAL and so on; units are those of the maker's driver: m/(s^2), deg/s, local_flux, ms, with "*"
where the unit has the default calibration. The tests read files that were made by hand in this form.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
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
from oarlock.formats.devices.trials import Trial, trial_at
from oarlock.formats.devices.unit_readings import UnitReadings, recording_of, source_of, stream_name
from oarlock.formats.listing import FileMatch, ListedFile, Listing
from oarlock.formats.times import ISO, Stamps, on_one_axis, parsed_stamps, relative_stamps
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.units import plain_unit, to_held_unit

_COLUMN = re.compile(
    r"(?P<unit>.+?)_(?P<channel>Accel_LN|Accel_WR|Gyro|Mag|Timestamp\w*?)(?:_(?P<axis>[XYZ]))?_(?P<kind>CAL|RAW)"
)
_OF_A_UNIT = "_X_"
"""In the names of all sensors."""
_CLOCKS = (
    *("TimestampSync_Unix", "Timestamp_Unix", "TimestampSync_FormattedUnix", "Timestamp_FormattedUnix"),
    *("TimestampSync", "Timestamp"),
)
"""Moments before a count from the unit's start, those of synchronised clocks first."""
_DATE_UNIT = "yyyy/mm/dd hh:mm:ss.000"
_DATE = re.compile(r"(\d{4})/(\d{2})/(\d{2}) (\d{2}:\d{2}:\d{2}(?:[.,]\d{1,6})?)", re.ASCII)
_ACCELS = ("LN", "WR")
_LOCAL_FLUX = "local_flux"
_NEEDED = MappingProxyType(
    {"accel_m_s2": ("m/s2",), "gyro_rad_s": ("deg/s", "rad/s"), "mag_ut": ("uT", _LOCAL_FLUX)}
)
_REPEATED = (
    " Stamps of a computer repeat when samples arrive together: export the file of the unit's card, or the unit's own "
    "Timestamp."
)


@dataclass(frozen=True)
class _ShimmerColumns:
    """Where the columns of one unit are: channel -> names of x, y, z; and its time column."""

    table: ExportedTable
    label: str
    channels: Mapping[str, tuple[str, ...]]
    clock: str

    def unit_of(self, name: str) -> str:
        """The unit of a column as the file has it."""
        units = self.table.below[0].split(self.table.layout.dialect.delimiter) if self.table.below else []
        place = self.table.layout.index(name)
        return units[place].strip().strip('"').strip() if place < len(units) else ""

    def fields(self, accel: str | None) -> dict[str, str]:
        """Field of the stream -> channel."""
        found = {"gyro_rad_s": "Gyro", "mag_ut": "Mag"}
        choice = next((c for c in _ACCELS if f"Accel_{c}" in self.channels), "LN") if accel is None else accel
        found["accel_m_s2"] = f"Accel_{choice}"
        return {field: channel for field, channel in found.items() if channel in self.channels}


def read_shimmer(path: str | PathLike[str], trial: str | None = None, accel: str | None = None) -> Recording:
    """Read calibrated exports of Shimmer Consensys: one file, or the files of a session.

    Args:
        path: a file, or a folder with a file for each unit.
        trial: which session, if the folder has several: what the files' names share.
        accel: accelerometer, LN (low noise) or WR (wide range); None: LN where there is one.

    Returns:
        One `ImuStream` per unit, named after its label in lower case. Moments are shifted to start at 0 s;
        ``meta["clock"]`` has the start time. A magnetometer in local flux is in arbitrary units: see `arbitrary_units`.

    Raises:
        DataError: Another layout or unit, no calibrated columns, a cell that is not a number; names file, line, column.
    """
    if accel is not None and accel not in _ACCELS:
        raise DataError(f'accel is "{accel}"; expected LN or WR')
    chosen = trial_at(place_of(path), trial, _trials, "exports of Shimmer Consensys")
    units = [unit for one in chosen.files for unit in _units(one)]
    columns = [_columns(unit, accel) for unit in units]
    stamps = [_stamps(unit, found) for unit, found in zip(units, columns, strict=True)]
    times, clock = on_one_axis(stamps, [f'{unit.table.file}, column "{unit.clock}"' for unit in units])
    readings = []
    for unit, found, time_s in zip(units, columns, times, strict=True):
        found.check_increasing(time_s, unit.clock, _REPEATED if unit.clock.endswith("Unix_CAL") else "")
        readings.append(_readings(unit, found, time_s, accel))
    said = {stream_name(unit.label): {"device": unit.label, "clock": unit.clock} for unit in units}
    read = {name for found in columns for name in (*found.values, *found.texts)}
    tables = list({unit.table.file: unit.table for unit in units}.values())
    return recording_of(
        readings, source_of("shimmer", chosen.name, tables, said, read), clock, False, _notes(units, accel)
    )


def find_shimmer(listing: Listing) -> list[FileMatch]:
    """The sessions among the .csv and .txt files of a place; units without a common clock are alone."""
    found = []
    for trial in _trials(listing):
        labels = {label for one in trial.files for label in _labels(one)}
        about = f"Shimmer Consensys, {len(labels)} {'unit' if len(labels) == 1 else 'units'}"
        found.append(trial.found("shimmer", about))
    return found


def _trials(listing: Listing) -> list[Trial]:
    groups: dict[tuple[str, str], list[ListedFile]] = {}
    for one in listing.suffixed(".csv", ".txt", ".dat"):
        labels = _labels(one)
        if not labels:
            continue
        header = _header(one)
        dated = header is not None and any(name.endswith("Unix_CAL") for name in header.names)
        name = re.sub(r"_+", "_", one.path.stem.replace(labels[0], "")).strip("_") if dated else ""
        groups.setdefault((str(one.path.parent), name or one.path.stem), []).append(one)
    return [Trial(files[0].path.parent, name, tuple(files)) for (_, name), files in groups.items()]


def _header(one: ListedFile) -> Header | None:
    return found_header(one.lines, _OF_A_UNIT, lambda names: any(_COLUMN.fullmatch(name) for name in names))


def _labels(one: ListedFile) -> list[str]:
    """The units that have a sensor in this file, raw or calibrated."""
    header = _header(one)
    found = [_COLUMN.fullmatch(name) for name in header.names] if header is not None else []
    return list(dict.fromkeys(c["unit"] for c in found if c is not None and c["axis"]))


def _units(one: ListedFile) -> list[_ShimmerColumns]:
    header = _header(one)
    if header is None:
        raise DataError(
            f"{one.path}: is not an export of Shimmer Consensys: no line has names such as Shimmer_40AC_Gyro_X_CAL"
        )
    table = exported_table(one, header, 1)
    channels: dict[str, dict[str, dict[str, str]]] = {}
    clocks: dict[str, dict[str, str]] = {}
    raw = False
    for name in table.layout.names:
        column = _COLUMN.fullmatch(name)
        if column is None or column["kind"] == "RAW":
            raw = raw or column is not None
        elif column["axis"]:
            channels.setdefault(column["unit"], {}).setdefault(column["channel"], {})[column["axis"]] = name
        elif column["channel"] in _CLOCKS:
            clocks.setdefault(column["unit"], {})[column["channel"]] = name
    if not channels:
        hint = (
            "only raw columns (_RAW). Export calibrated data (CAL)."
            if raw
            else "no accelerometer, gyroscope or magnetometer."
        )
        raise DataError(f"{one.path}:{header.row + 1}: has {hint}")
    return [
        _ShimmerColumns(table, label, _complete(table, label, found), _clock(table, label, clocks))
        for label, found in channels.items()
    ]


def _complete(
    table: ExportedTable, label: str, channels: Mapping[str, Mapping[str, str]]
) -> dict[str, tuple[str, ...]]:
    found = {}
    for channel, axes in channels.items():
        if missing := [axis for axis in "XYZ" if axis not in axes]:
            raise DataError(f'{table.file}: unit "{label}" has no column {label}_{channel}_{missing[0]}_CAL')
        found[channel] = tuple(axes[axis] for axis in "XYZ")
    return found


def _clock(table: ExportedTable, label: str, clocks: Mapping[str, Mapping[str, str]]) -> str:
    own = clocks.get(label) or (next(iter(clocks.values())) if len(clocks) == 1 else {})
    name = next((own[channel] for channel in _CLOCKS if channel in own), None)
    if name is None:
        raise DataError(
            f'{table.file}: unit "{label}" has no calibrated time column such as {label}_Timestamp_Unix_CAL'
        )
    return name


def _columns(unit: _ShimmerColumns, accel: str | None) -> Columns:
    fields = unit.fields(accel)
    if not fields:
        raise DataError(f'{unit.table.file}: unit "{unit.label}" has no accelerometer {accel}')
    wanted = [name for channel in fields.values() for name in unit.channels[channel]]
    dated = unit.clock.endswith("Unix_CAL")
    return read_columns_of(
        unit.table, wanted if dated else [*wanted, unit.clock], [unit.clock] if dated else []
    )


def _stamps(unit: _ShimmerColumns, columns: Columns) -> Stamps:
    found = unit.unit_of(unit.clock)
    formatted = unit.clock.endswith("_FormattedUnix_CAL")
    needed = _DATE_UNIT if formatted else "ms"
    if found != needed:
        raise _wrong_unit(unit, unit.clock, found, needed)
    if not unit.clock.endswith("Unix_CAL"):
        return relative_stamps(columns.present(unit.clock, "time"), "ms")
    places = columns.places(unit.clock)
    cells = columns.texts[unit.clock]
    return parsed_stamps(
        [_iso(cell) for cell in cells] if formatted else cells, places, ISO if formatted else "epoch_ms"
    )


def _iso(cell: str) -> str:
    date = _DATE.fullmatch(cell.strip())
    return f"{date[1]}-{date[2]}-{date[3]}T{date[4].replace(',', '.')}" if date else cell


def _readings(unit: _ShimmerColumns, columns: Columns, time_s: Floats, accel: str | None) -> UnitReadings:
    fields: dict[str, Floats] = {}
    for field, channel in unit.fields(accel).items():
        names = unit.channels[channel]
        found = {plain_unit(re.sub(r"[()*]", "", unit.unit_of(name))) for name in names}
        kind = found.pop() if len(found) == 1 else ""
        if kind not in _NEEDED[field]:
            raise _wrong_unit(unit, names[0], unit.unit_of(names[0]), " or ".join(_NEEDED[field]))
        rows = columns.rows(names)
        fields["mag_arbitrary" if kind == _LOCAL_FLUX else field] = (
            rows if kind == _LOCAL_FLUX else to_held_unit(rows, kind)
        )
    return UnitReadings(stream_name(unit.label), time_s, **fields, lost=None)


def _wrong_unit(unit: _ShimmerColumns, name: str, found: str, needed: str) -> DataError:
    line = unit.table.layout.dialect.skip_rows + 2
    return DataError(
        f'{unit.table.file}:{line}, column "{name}": the unit is "{found}", expected {needed}. Export calibrated data '
        "with the line of units."
    )


def _notes(units: list[_ShimmerColumns], accel: str | None) -> list[str]:
    return [
        f"{unit.label}: {channel} has the default calibration of its kind, not that of this unit."
        for unit in units
        for channel in unit.fields(accel).values()
        if any(unit.unit_of(name).endswith("*") for name in unit.channels[channel])
    ]
