"""Reads CSV files of any device as described by a mapping file, for `oarlock import csv`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import cast

import numpy as np

from oarlock.formats.arbitrary_units import ARBITRARY, scale_meta, scaled_mag
from oarlock.formats.columns import Places
from oarlock.formats.counters import Lost, lost_packets, unwrapped
from oarlock.formats.csv_mapping import (
    Counter,
    CsvMapping,
    FileMapping,
    Quantity,
    SensorColumns,
    read_mapping,
)
from oarlock.formats.csv_time import TimeUnit, counted_stamps, time_unit
from oarlock.formats.listing import FileMatch, Listing
from oarlock.formats.merged import merged
from oarlock.formats.times import SAMPLES, Stamps, on_one_axis, parsed_stamps, relative_stamps
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.packets import META_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, ScalarUnit, Stream, VectorStream
from oarlock.storage.array_gate import disorder_text
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.delimited import ColumnLayout, numbers
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.units import ANGLE, to_held_unit

_FILE_TABLE = re.compile(r"\s*\[\[\s*file\s*\]\]")


@dataclass(frozen=True)
class _CsvColumns:
    """Columns of one file: time stamps, line numbers, and readings by column position."""

    layout: ColumnLayout
    stamps: Stamps
    lines: Ints
    columns: dict[int, Floats]
    unit: TimeUnit
    said: tuple[str, ...]


@dataclass(frozen=True)
class _Part:
    """The data of one sensor in one file, on the common clock."""

    sensor: SensorColumns
    time_s: Floats
    fields: dict[str, Floats]


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
    return read_mapped(mapping, root, {"format": "csv", "mapping": mapping.file.name})


def read_mapped(
    mapping: CsvMapping, root: Path, source: Mapping[str, object], most_rows: int | None = None
) -> Recording:
    """Read the files of a checked mapping.

    Args:
        mapping: files, columns, units and sensors.
        root: folder from which the files' paths begin.
        source: entries of ``meta["source"]``.
        most_rows: read about this many rows of each file; None: all.

    Raises:
        DataError: A mistake in the data (file, line, column, text found).
    """
    tables = [_read_table(f, root, most_rows) for f in mapping.files]
    times, clock = on_one_axis([t.stamps for t in tables], [str(t.layout.file) for t in tables])
    parts: list[_Part] = []
    lost: dict[str, Lost] = {}
    for entry, table, seconds in zip(mapping.files, tables, times, strict=True):
        _check_increasing(table, seconds, entry)
        time_s = seconds + entry.time_offset_s
        parts += [_part(s, table, time_s) for s in entry.sensors]
        if entry.counter is not None:
            lost |= dict.fromkeys((s.name for s in entry.sensors), _lost(table, time_s, entry.counter))
    streams, notes, scales = _streams(parts)
    told = {"notes": notes} if notes else {}
    files = list(dict.fromkeys(t.layout.file.name for t in tables))
    said = [sentence for table in tables for sentence in table.said]
    clock |= {"found": said} if said else {}
    meta = {
        "source": {**source, "files": files, **told},
        CLOCK_KEY: clock,
        **({META_KEY: lost} if lost else {}),
    }
    return Recording(streams, meta | dict(scales) | dict(mapping.meta))


def _lost(table: _CsvColumns, time_s: Floats, counter: Counter) -> Lost:
    index = table.layout.index(counter.column)
    places = Places(table.layout, table.lines, index)
    count = table.columns[index]
    if counter.wraps_at is not None:
        count = unwrapped(count, counter.wraps_at, places)
    return lost_packets(count, time_s, places)


def _read_table(entry: FileMapping, root: Path, most_rows: int | None) -> _CsvColumns:
    file = place_of(root / entry.path)
    if not file.is_file():
        raise DataError(f'{entry.where}: there is no file "{file}"')
    layout = ColumnLayout.of(file, entry.dialect)
    if entry.time_column is None:
        return _counted_rows(layout, entry, most_rows)
    time_index = layout.index(entry.time_column)
    wanted = list(dict.fromkeys([time_index, *_wanted(layout, entry)]))
    unit = time_unit(layout, entry)
    lines, stamps, joined = _columns(layout, wanted, as_text=0 if unit.counted else 1, most_rows=most_rows)
    if unit.counted:
        lines, joined = _without_empty_end(lines, joined)
    places = Places(layout, np.array(lines, dtype=np.int64), time_index)
    if unit.counted:
        _check_present(layout, time_index, joined[time_index], lines)
        axis, said = counted_stamps(joined[time_index], unit, entry, places)
    else:
        axis, said = parsed_stamps(stamps, places, unit.unit), ()
    return _CsvColumns(layout, axis, np.array(lines, dtype=np.int64), joined, unit, (*unit.said, *said))


def _counted_rows(layout: ColumnLayout, entry: FileMapping, most_rows: int | None) -> _CsvColumns:
    """A file without a time column: its rows are samples at the rate that the mapping gives."""
    assert entry.tick_s is not None
    lines, _, joined = _columns(layout, _wanted(layout, entry), as_text=0, most_rows=most_rows)
    axis = relative_stamps(np.arange(float(len(lines))), SAMPLES, entry.tick_s)
    return _CsvColumns(
        layout, axis, np.array(lines, dtype=np.int64), joined, TimeUnit(SAMPLES, entry.tick_s, ()), ()
    )


def _columns(
    layout: ColumnLayout, wanted: Sequence[int], as_text: int, most_rows: int | None
) -> tuple[list[int], list[str], dict[int, Floats]]:
    """Line numbers, texts of the first column if it is wanted `as_text`, and the other columns by position."""
    lines: list[int] = []
    texts: list[str] = []
    readings: list[list[Floats]] = [[] for _ in wanted]
    for batch in layout.batches(wanted):
        lines += batch.lines
        if as_text:
            texts += batch.cells[0]
        for position in range(as_text, len(wanted)):
            readings[position].append(numbers(layout, batch, position, wanted[position]))
        if most_rows is not None and len(lines) >= most_rows:
            break
    if not lines:
        raise DataError(f"{layout.file}: has no rows of data")
    return lines, texts, {i: np.concatenate(r) for i, r in zip(wanted, readings, strict=True) if r}


def _without_empty_end(lines: list[int], columns: dict[int, Floats]) -> tuple[list[int], dict[int, Floats]]:
    """The rows up to the last one that has any number: beside a faster sensor, a slower one's columns end earlier."""
    filled = np.flatnonzero(np.logical_or.reduce([np.isfinite(values) for values in columns.values()]))
    stop = int(filled[-1]) + 1 if filled.size else len(lines)
    return lines[:stop], {index: values[:stop] for index, values in columns.items()}


def _wanted(layout: ColumnLayout, entry: FileMapping) -> list[int]:
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


def _check_present(layout: ColumnLayout, index: int, values: Floats, lines: list[int]) -> None:
    missing = np.flatnonzero(np.isnan(values))
    if missing.size:
        raise DataError(
            f"{layout.file}:{lines[missing[0]]}, {layout.label(index)}: the time is missing "
            f"({missing.size} of {values.size} rows). Remove these rows."
        )


def _check_increasing(table: _CsvColumns, time_s: Floats, entry: FileMapping) -> None:
    if entry.time_column is None:
        return
    late = np.flatnonzero(np.diff(time_s) <= 0.0)
    if late.size:
        index = int(late[0]) + 1
        label = table.layout.label(table.layout.index(entry.time_column))
        back = time_s[index] < time_s[index - 1] and table.unit.counted and entry.time_wraps_at is None
        hint = " If the device's clock restarts at 0, give time.wraps_at." if back else ""
        raise DataError(
            f"{table.layout.file}:{table.lines[index]}, {label}: time_s{disorder_text(time_s, index)}{hint}"
        )


def _part(sensor: SensorColumns, table: _CsvColumns, time_s: Floats) -> _Part:
    return _Part(sensor, time_s, {q.field: _readings(q, table) for q in sensor.quantities})


def _readings(quantity: Quantity, table: _CsvColumns) -> Floats:
    raw = np.column_stack([table.columns[table.layout.index(c)] for c in quantity.columns])
    if any(s != 1.0 for s in quantity.scale) or any(o != 0.0 for o in quantity.offset):
        raw = raw * np.array(quantity.scale) + np.array(quantity.offset)
    held = raw if quantity.unit == ARBITRARY else to_held_unit(raw, quantity.unit)
    turned = np.column_stack([held[:, i] if sign > 0 else -held[:, i] for i, sign in quantity.axes])
    return turned[:, 0] if quantity.field == "value" and len(quantity.columns) == 1 else turned


def _streams(parts: Sequence[_Part]) -> tuple[list[Stream], list[str], Mapping[str, object]]:
    """The streams, sentences on magnetometers in arbitrary units, and the factors of these."""
    arbitrary: dict[str, Floats] = {}
    notes: list[str] = []
    by_name: dict[str, list[_Part]] = {}
    for part in parts:
        if any(q.unit == ARBITRARY for q in part.sensor.quantities):
            arbitrary[part.sensor.name] = part.fields["mag_ut"]
            part, note = _scaled(part)
            notes.append(note)
        by_name.setdefault(part.sensor.name, []).append(part)
    streams = [_stream(same) for same in by_name.values() if any(part.fields for part in same)]
    return streams, notes, scale_meta(arbitrary)


def _scaled(part: _Part) -> tuple[_Part, str]:
    mag_ut, note = scaled_mag(part.fields["mag_ut"], part.sensor.name)
    others = {name: values for name, values in part.fields.items() if name != "mag_ut"}
    return replace(part, fields=others if mag_ut is None else {**others, "mag_ut": mag_ut}), note


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
    return ScalarStream(name, time_s, fields["value"], cast("ScalarUnit", unit))


def find_csv(listing: Listing) -> list[FileMatch]:
    """Mapping files of a place, with the CSV files that they name."""
    found = []
    for one in listing.suffixed(".toml"):
        if not any(_FILE_TABLE.match(line) for line in one.lines):
            continue
        try:
            mapping = read_mapping(one.path)
        except DataError as error:
            if one.path == listing.root:
                raise
            about = f"mapping file with a mistake: {str(error).splitlines()[0]}"
            found.append(FileMatch("csv", one.path, (one.path,), one.path.stem, about))
            continue
        files = [one.path, *(one.path.parent / entry.path for entry in mapping.files)]
        sensors = {sensor.name for entry in mapping.files for sensor in entry.sensors}
        name = one.path.parent.name if one.path.stem == "mapping" else one.path.stem
        about = f"mapping file, {len(sensors)} sensors"
        found.append(FileMatch("csv", one.path, tuple(dict.fromkeys(files)), name or one.path.stem, about))
    return found
