"""Reads CSV files of any device as described by a mapping file, for `oarlock import csv`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.counters import Lost, lost_packets, unwrapped
from oarlock.formats.csv_mapping import Counter, FileMapping, Quantity, SensorColumns, read_mapping
from oarlock.formats.csv_time import TimeUnit, counted_stamps, time_unit
from oarlock.formats.merged import merged
from oarlock.formats.times import Stamps, on_one_axis, parsed_stamps
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.packets import META_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, ScalarUnit, Stream, VectorStream
from oarlock.storage.array_gate import FloatArray, disorder_text
from oarlock.storage.delimited import Layout, numbers
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.units import ANGLE, to_held_unit


@dataclass(frozen=True)
class _Table:
    """Columns of one file: time stamps, line numbers, and readings by column position."""

    layout: Layout
    stamps: Stamps
    lines: NDArray[np.int64]
    columns: dict[int, FloatArray]
    unit: TimeUnit
    said: tuple[str, ...]


class _Places(Sequence[str]):
    """File, line and column of each row, as text for errors."""

    def __init__(self, layout: Layout, lines: NDArray[np.int64], index: int) -> None:
        self._layout, self._lines, self._index = layout, lines, index

    def __len__(self) -> int:
        return len(self._lines)

    def __getitem__(self, row: Any) -> Any:
        return f"{self._layout.file}:{self._lines[row]}, {self._layout.label(self._index)}"


@dataclass(frozen=True)
class _Part:
    """The data of one sensor in one file, on the common clock."""

    sensor: SensorColumns
    time_s: FloatArray
    fields: dict[str, FloatArray]


def read_csv(mapping_file: str | PathLike[str], folder: str | PathLike[str] | None = None) -> Recording:
    """Read CSV files into a recording in SI units.

    Args:
        mapping_file: the TOML file that names files, columns, units and sensors.
        folder: where the CSV files are; the mapping file's own folder if not given, so that one mapping
            serves many trials.

    Returns:
        One stream per sensor. A sensor whose gyro, accel and mag come from several files has all their time stamps,
        with NaN where a file has no reading.

    Raises:
        DataError: A mistake in the mapping (file, line, key) or in the data (file, line, column, text found).
    """
    mapping = read_mapping(place_of(mapping_file))
    root = place_of(folder) if folder is not None else mapping.file.parent
    tables = [_read_table(f, root) for f in mapping.files]
    times, clock = on_one_axis([t.stamps for t in tables], [str(t.layout.file) for t in tables])
    parts: list[_Part] = []
    lost: dict[str, Lost] = {}
    for entry, table, seconds in zip(mapping.files, tables, times, strict=True):
        _check_increasing(table, seconds, entry)
        time_s = seconds + entry.time_offset_s
        parts += [_part(s, table, time_s) for s in entry.sensors]
        if entry.counter is not None:
            lost |= dict.fromkeys((s.name for s in entry.sensors), _lost(table, time_s, entry.counter))
    source = {"format": "csv", "mapping": mapping.file.name, "files": [t.layout.file.name for t in tables]}
    said = [sentence for table in tables for sentence in table.said]
    clock |= {"found": said} if said else {}
    meta = {"source": source, CLOCK_KEY: clock, **({META_KEY: lost} if lost else {})}
    return Recording(_streams(parts), meta | dict(mapping.meta))


def _lost(table: _Table, time_s: FloatArray, counter: Counter) -> Lost:
    index = table.layout.index(counter.column)
    places = _Places(table.layout, table.lines, index)
    count = table.columns[index]
    if counter.wraps_at is not None:
        count = unwrapped(count, counter.wraps_at, places)
    return lost_packets(count, time_s, places)


def _read_table(entry: FileMapping, root: Path) -> _Table:
    file = place_of(root / entry.path)
    if not file.is_file():
        raise DataError(f'{entry.where}: there is no file "{file}"')
    layout = Layout.of(file, entry.dialect)
    time_index = layout.index(entry.time_column)
    wanted = list(dict.fromkeys([time_index, *_wanted(layout, entry)]))
    unit = time_unit(layout, entry)
    lines: list[int] = []
    stamps: list[str] = []
    readings: list[list[FloatArray]] = [[] for _ in wanted]
    for batch in layout.batches(wanted):
        lines += batch.lines
        if not unit.counted:
            stamps += batch.cells[0]
        for position in range(0 if unit.counted else 1, len(wanted)):
            readings[position].append(numbers(layout, batch, position, wanted[position]))
    if not lines:
        raise DataError(f"{file}: has no rows of data")
    joined = {i: np.concatenate(r) for i, r in zip(wanted, readings, strict=True) if r}
    places = _Places(layout, np.array(lines, dtype=np.int64), time_index)
    if unit.counted:
        _check_present(layout, time_index, joined[time_index], lines)
        axis, said = counted_stamps(joined[time_index], unit, entry, places)
    else:
        axis, said = parsed_stamps(stamps, places, unit.unit), ()
    return _Table(layout, axis, np.array(lines, dtype=np.int64), joined, unit, (*unit.said, *said))


def _wanted(layout: Layout, entry: FileMapping) -> list[int]:
    """Positions of the columns that sensors use, each once; errors name the line of the mapping file."""
    found: dict[int, None] = {}
    for quantity in (q for s in entry.sensors for q in s.quantities):
        for column in quantity.columns:
            try:
                found[layout.index(column)] = None
            except DataError as error:
                raise DataError(f"{quantity.where}: {error}") from error
    if entry.counter is not None:
        found[layout.index(entry.counter.column)] = None
    return list(found)


def _check_present(layout: Layout, index: int, values: FloatArray, lines: list[int]) -> None:
    missing = np.flatnonzero(np.isnan(values))
    if missing.size:
        raise DataError(
            f"{layout.file}:{lines[missing[0]]}, {layout.label(index)}: the time is missing "
            f"({missing.size} of {values.size} rows). Remove these rows."
        )


def _check_increasing(table: _Table, time_s: FloatArray, entry: FileMapping) -> None:
    late = np.flatnonzero(np.diff(time_s) <= 0.0)
    if late.size:
        index = int(late[0]) + 1
        label = table.layout.label(table.layout.index(entry.time_column))
        back = time_s[index] < time_s[index - 1] and table.unit.counted and entry.time_wraps_at is None
        hint = " If the device's clock restarts at 0, give time.wraps_at." if back else ""
        raise DataError(
            f"{table.layout.file}:{table.lines[index]}, {label}: time_s{disorder_text(time_s, index)}{hint}"
        )


def _part(sensor: SensorColumns, table: _Table, time_s: FloatArray) -> _Part:
    return _Part(sensor, time_s, {q.field: _readings(q, table) for q in sensor.quantities})


def _readings(quantity: Quantity, table: _Table) -> FloatArray:
    raw = np.column_stack([table.columns[table.layout.index(c)] for c in quantity.columns])
    if any(s != 1.0 for s in quantity.scale) or any(o != 0.0 for o in quantity.offset):
        raw = raw * np.array(quantity.scale) + np.array(quantity.offset)
    held = to_held_unit(raw, quantity.unit)
    turned = np.column_stack([held[:, i] if sign > 0 else -held[:, i] for i, sign in quantity.axes])
    return turned[:, 0] if quantity.field == "value" and len(quantity.columns) == 1 else turned


def _streams(parts: Iterable[_Part]) -> list[Stream]:
    by_name: dict[str, list[_Part]] = {}
    for part in parts:
        by_name.setdefault(part.sensor.name, []).append(part)
    return [_stream(same) for same in by_name.values()]


def _stream(parts: list[_Part]) -> Stream:
    first = parts[0]
    seen: set[str] = set()
    for part in parts:
        if part.sensor.kind != first.sensor.kind or seen & part.fields.keys():
            raise DataError(
                f'{part.sensor.where}: sensor "{part.sensor.name}" is already defined ({first.sensor.where}). '
                "Only gyro, accel and mag of one sensor may come from different files."
            )
        seen |= part.fields.keys()
    time_s, fields = merged([(p.time_s, p.fields) for p in parts])
    name = first.sensor.name
    if first.sensor.kind == "imu":
        return ImuStream(name, time_s, **fields)
    if first.sensor.kind == "vector":
        return VectorStream(name, time_s, fields["value"])
    unit = "rad" if first.sensor.quantities[0].unit in ANGLE else "m"
    return ScalarStream(name, time_s, fields["value"], cast(ScalarUnit, unit))
