"""Reads and checks the mapping file of `oarlock import csv`: columns, units and sensors."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Literal, TypeAlias

from oarlock.formats.arbitrary_units import ARBITRARY
from oarlock.formats.times import COUNTED, SAMPLES, TICKS, TIME_UNITS, plain_time_unit
from oarlock.storage.delimited import MISSING_MARKERS, Dialect
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable
from oarlock.storage.units import ACCEL, ANGLE, GYRO, LENGTH, MAG, plain_unit, unknown_unit_text

Column: TypeAlias = str | int
Kind: TypeAlias = Literal["imu", "scalar", "vector"]

# key of a sensor -> (kind of stream, field of the stream, units)
QUANTITIES: Mapping[str, tuple[Kind, str, tuple[str, ...]]] = MappingProxyType(
    {
        "gyro": ("imu", "gyro_rad_s", GYRO),
        "accel": ("imu", "accel_m_s2", ACCEL),
        "mag": ("imu", "mag_ut", (*MAG, ARBITRARY)),
        "value": ("scalar", "value", (*LENGTH, *ANGLE)),
        "position": ("vector", "value", LENGTH),
    }
)


@dataclass(frozen=True)
class Quantity:
    """One measured quantity: reading = unit * (scale * cell + offset), then converted to the sensor's axes.

    Args:
        field: the stream's field, such as "gyro_rad_s".
        columns: one column or three, by name or by number from 1.
        unit: of scale * cell + offset.
        scale: one factor per column.
        offset: one offset per column, in `unit`.
        axes: for each axis of the stream (position among the columns, +1 or -1).
        where: file, line and key, for errors.
    """

    field: str
    columns: tuple[Column, ...]
    unit: str
    scale: tuple[float, ...]
    offset: tuple[float, ...]
    axes: tuple[tuple[int, int], ...]
    where: str


@dataclass(frozen=True)
class SensorColumns:
    """One sensor: name, kind of stream, and its quantities in a file."""

    name: str
    kind: Kind
    quantities: tuple[Quantity, ...]
    where: str


@dataclass(frozen=True)
class Counter:
    """A column in which the device counts its packets.

    Args:
        column: by name or by number from 1.
        wraps_at: the count at which it restarts at 0; None if it never does.
    """

    column: Column
    wraps_at: float | None


@dataclass(frozen=True)
class FileMapping:
    """One CSV file: its format, time column and sensors.

    Args:
        path: relative to the mapping file's folder, or to the folder given with it.
        dialect: delimiter, decimal mark, encoding, header.
        time_column: by name or by number from 1; None: the rows are counted.
        time_unit: one of `TIME_UNITS`; None: recognised from the column.
        time_offset_s: added to every time stamp, to align another device's clock with the common one.
        time_wraps_at: value at which the time column restarts at 0, in its own unit; None if it never does.
        tick_s: length of a tick or a sample, for the units "ticks" and "samples"; None: found in the file.
        counter: the device's count of packets, if there is one.
        sensors: at least one.
        where: file and line of the table, for errors.
    """

    path: str
    dialect: Dialect
    time_column: Column | None
    time_unit: str | None
    time_offset_s: float
    time_wraps_at: float | None
    tick_s: float | None
    counter: Counter | None
    sensors: tuple[SensorColumns, ...]
    where: str


@dataclass(frozen=True)
class CsvMapping:
    """A checked mapping file."""

    file: Path
    files: tuple[FileMapping, ...]
    meta: Mapping[str, object]


def read_mapping(file: Path) -> CsvMapping:
    """Read and check a mapping file; every mistake is a `DataError` with file, line and key."""
    return mapping_of(TomlTable.read(file))


def mapping_of(top: TomlTable) -> CsvMapping:
    """Check the text of a mapping; every mistake is a `DataError` with file, line and key."""
    top.check_keys({"format", "meta", "file"})
    top.check_format(1)
    return CsvMapping(
        top.file, tuple(_file(t) for t in top.tables("file")), top.table("meta", default={}).values
    )


def _file(table: TomlTable) -> FileMapping:
    table.check_keys({*_DIALECT_KEYS, "path", "time", "counter", "sensor"})
    time = table.table("time")
    time.check_keys({"column", "unit", "offset_s", "wraps_at", "tick_s", "rate_hz"})
    unit = _time_unit(time)
    return FileMapping(
        path=table.string("path"),
        dialect=_dialect(table),
        time_column=_time_column(time, unit),
        time_unit=unit,
        time_offset_s=time.number("offset_s", 0.0),
        time_wraps_at=_time_wraps_at(time, unit),
        tick_s=_tick_s(time, unit),
        counter=_counter(table),
        sensors=tuple(_sensor(s) for s in table.tables("sensor")),
        where=table.where(),
    )


def _time_column(time: TomlTable, unit: str | None) -> Column | None:
    """The time column; a file without one has rows at a rate."""
    if "column" not in time.values and unit == SAMPLES and "rate_hz" in time.values:
        return None
    return _column(time, "column", time.require("column"))


def _time_unit(time: TomlTable) -> str | None:
    if "unit" not in time.values:
        return SAMPLES if "rate_hz" in time.values else None
    unit = plain_time_unit(time.string("unit"))
    if unit not in TIME_UNITS:
        raise DataError(
            f'{time.where("unit")}: the time unit "{unit}" is not known. {did_you_mean(unit, TIME_UNITS)} '
            "Without a unit it is recognised from the column."
        )
    return unit


def _time_wraps_at(time: TomlTable, unit: str | None) -> float | None:
    if "wraps_at" in time.values and unit is not None and unit not in COUNTED:
        raise DataError(
            f'{time.where("wraps_at")}: a time in "{unit}" does not wrap; wraps_at needs {", ".join(COUNTED)}'
        )
    return _wraps_at(time)


def _wraps_at(table: TomlTable) -> float | None:
    if "wraps_at" not in table.values:
        return None
    modulus = table.number("wraps_at", 0.0)
    if not modulus > 1.0:
        raise DataError(
            f"{table.where('wraps_at')}: is {modulus:g}; expected the restart count, such as 65536 or 4294967296"
        )
    return modulus


def _tick_s(time: TomlTable, unit: str | None) -> float | None:
    if "rate_hz" in time.values and unit != SAMPLES:
        raise DataError(f'{time.where("rate_hz")}: the rate of a count needs unit = "{SAMPLES}"')
    if unit == SAMPLES:
        return 1.0 / _above_zero(time, "rate_hz", "rate in Hz") if "rate_hz" in time.values else None
    given = "tick_s" in time.values
    if given != (unit == TICKS):
        raise DataError(
            f'{time.where("tick_s" if given else "unit")}: the unit "{TICKS}" and tick_s, the length of a tick in s, '
            "go together"
        )
    return _above_zero(time, "tick_s", "length of a tick in s") if given else None


def _above_zero(table: TomlTable, key: str, meaning: str) -> float:
    value = table.number(key, 0.0)
    if not value > 0.0:
        raise DataError(f"{table.where(key)}: is {value:g}; expected the {meaning}")
    return value


def _counter(table: TomlTable) -> Counter | None:
    if "counter" not in table.values:
        return None
    counter = table.table("counter")
    counter.check_keys({"column", "wraps_at"})
    return Counter(_column(counter, "column", counter.require("column")), _wraps_at(counter))


_DIALECT_KEYS = ("delimiter", "decimal", "encoding", "skip_rows", "header", "skip_after_header", "missing")


def _dialect(table: TomlTable) -> Dialect:
    dialect = Dialect(
        delimiter=table.string("delimiter", ","),
        decimal=table.string("decimal", "."),
        encoding=table.string("encoding", "utf-8"),
        skip_rows=table.integer("skip_rows", 0),
        header=table.boolean("header", True),
        skip_after_header=table.integer("skip_after_header", 0),
        missing=_markers(table),
    )
    if len(dialect.delimiter) != 1 or dialect.delimiter in '"\r\n':
        raise DataError(
            f"{table.where('delimiter')}: is {dialect.delimiter!r}; expected one character, such as ; or \\t"
        )
    if dialect.decimal not in (".", ","):
        raise DataError(f'{table.where("decimal")}: is {dialect.decimal!r}; expected "." or ","')
    if dialect.skip_after_header and not dialect.header:
        raise DataError(f"{table.where('skip_after_header')}: there is no header; use skip_rows")
    return dialect


def _markers(table: TomlTable) -> tuple[str, ...]:
    found = table.values.get("missing", list(MISSING_MARKERS))
    if not isinstance(found, list) or not all(isinstance(m, str) for m in found):
        raise DataError(
            f'{table.where("missing")}: is {found!r}; expected a list of texts, such as ["", "---"]'
        )
    return tuple(m.strip() for m in found)


def _sensor(table: TomlTable) -> SensorColumns:
    table.check_keys({"name", *QUANTITIES})
    name = table.string("name")
    given = [key for key in table.values if key in QUANTITIES]
    if not given:
        raise DataError(f'{table.where()}: sensor "{name}" has no quantity. Give {", ".join(QUANTITIES)}.')
    kinds = {QUANTITIES[key][0] for key in given}
    if len(kinds) > 1:
        raise DataError(
            f'{table.where()}: sensor "{name}" mixes {", ".join(given)}. '
            "One sensor has gyro, accel and mag, or one value, or one position."
        )
    return SensorColumns(name, kinds.pop(), tuple(_quantity(table.table(k), k) for k in given), table.where())


def _quantity(table: TomlTable, key: str) -> Quantity:
    kind, field, units = QUANTITIES[key]
    if kind == "scalar":
        table.check_keys({"column", "unit", "scale", "offset"})
        columns: tuple[Column, ...] = (_column(table, "column", table.require("column")),)
        axes: tuple[tuple[int, int], ...] = ((0, 1),)
    else:
        table.check_keys({"columns", "unit", "axes", "scale", "offset"})
        columns, axes = _three_columns(table), _axes(table)
    unit = plain_unit(table.string("unit"))
    if unit not in units:
        raise DataError(f"{table.where('unit')}: {unknown_unit_text(unit, units)}")
    scale, offset = (_per_column(table, k, d, len(columns)) for k, d in (("scale", 1.0), ("offset", 0.0)))
    if 0.0 in scale:
        raise DataError(f"{table.where('scale')}: is 0, so all readings would be 0")
    return Quantity(field, columns, unit, scale, offset, axes, table.where())


def _column(table: TomlTable, key: str, value: object) -> Column:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise DataError(f"{table.where(key)}: is {value!r}; expected a column's name, or its number from 1")
    return value


def _three_columns(table: TomlTable) -> tuple[Column, ...]:
    found = table.require("columns")
    if not isinstance(found, list) or len(found) != 3:
        raise DataError(f"{table.where('columns')}: is {found!r}; expected three columns, for x, y and z")
    columns = tuple(_column(table, "columns", c) for c in found)
    if len(set(columns)) < 3:
        raise DataError(f"{table.where('columns')}: names a column twice: {found!r}")
    return columns


def _axes(table: TomlTable) -> tuple[tuple[int, int], ...]:
    found = table.values.get("axes", ["x", "y", "z"])
    given = [a for a in found if isinstance(a, str)] if isinstance(found, list) else []
    if sorted(a.removeprefix("-").removeprefix("+") for a in given) != ["x", "y", "z"]:
        raise DataError(
            f"{table.where('axes')}: is {found!r}; expected each of x, y and z once, "
            'with "-" where the axis points the other way, such as ["x", "-y", "-z"]'
        )
    return tuple(("xyz".index(a[-1]), -1 if a.startswith("-") else 1) for a in given)


def _per_column(table: TomlTable, key: str, default: float, count: int) -> tuple[float, ...]:
    value = table.values.get(key)
    if isinstance(value, list):
        entries = [
            TomlTable({key: v}, table.file, table.text, table.path).number(key, default) for v in value
        ]
        if len(entries) != count:
            raise DataError(f"{table.where(key)}: has {len(entries)} numbers for {count} columns")
        return tuple(entries)
    return (table.number(key, default),) * count
