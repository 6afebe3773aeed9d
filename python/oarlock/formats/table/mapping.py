"""Makes the mapping of a table without a mapping file: the one that `--save-mapping` writes and the reader uses."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

from oarlock.formats.arbitrary_units import ARBITRARY
from oarlock.formats.choices import UnclearError
from oarlock.formats.columns import read_columns
from oarlock.formats.csv import read_mapped
from oarlock.formats.csv_mapping import CsvMapping, mapping_of
from oarlock.formats.table.columns import TableColumns, UnitColumns, table_columns
from oarlock.formats.table.header import Quantity
from oarlock.formats.table.layout import TableStart, table_start
from oarlock.formats.table.measured import accel_unit, gyro_unit, mag_unit
from oarlock.formats.table.time_column import column_names, counter_table, time_table
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.delimited import MISSING_MARKERS, ColumnLayout
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, toml_text
from oarlock.storage.units import ACCEL, GYRO, MAG

Units: TypeAlias = Mapping[tuple[str, Quantity], str]
"""Unit of measurement of each quantity of each inertial unit."""

_ASK: tuple[tuple[Quantity, tuple[str, ...], Callable[[str, Sequence[ImuStream]], tuple[str, str]]], ...] = (
    ("accel", ACCEL, accel_unit),
    ("gyro", GYRO, gyro_unit),
    ("mag", (*MAG, ARBITRARY), mag_unit),
)
_ROWS_TO_MEASURE = 60_000
"""Ten minutes at 100 Hz: usually enough motion and rest to recognise units of measurement."""
_HELD: Mapping[Quantity, str] = MappingProxyType({"accel": "m/s2", "gyro": "rad/s", "mag": "uT"})


@dataclass(frozen=True)
class Given:
    """What the caller knows about a table; None for what shall be recognised.

    Args:
        accel_unit: of the accelerometers' columns.
        gyro_unit: of the gyroscopes' columns.
        mag_unit: of the magnetometers' columns.
        time_unit: of the time column.
        rate_hz: rows in a second; a time column is then not used.
    """

    accel_unit: str | None = None
    gyro_unit: str | None = None
    mag_unit: str | None = None
    time_unit: str | None = None
    rate_hz: float | None = None

    def of(self, quantity: Quantity) -> str | None:
        """The unit of a quantity."""
        return {"accel": self.accel_unit, "gyro": self.gyro_unit, "mag": self.mag_unit}.get(quantity)


@dataclass(frozen=True)
class TableMapping:
    """A table's mapping.

    Args:
        start: the layout of the table.
        columns: its columns by their meaning.
        document: the mapping, with the table's name as path.
        notes: what was recognised and why, one sentence each.
    """

    start: TableStart
    columns: TableColumns
    document: Mapping[str, object]
    notes: tuple[str, ...]

    def checked(self) -> CsvMapping:
        """The mapping for the reader of mapped files."""
        return _checked(self.start.file, self.document)

    def text(self, path: str) -> str:
        """The mapping as TOML, with another path of the table."""
        tables = self.document["file"]
        assert isinstance(tables, list)
        return toml_text({**self.document, "file": [{**table, "path": path} for table in tables]})


def table_mapping(file: Path, given: Given) -> TableMapping:
    """The mapping of a table.

    Args:
        file: the table.
        given: what is known already.

    Raises:
        UnclearError: a unit or the time is not clear; the error has the choices.
        DataError: it is no table of text, or no column belongs to an inertial unit.
    """
    start = table_start(file)
    columns = table_columns(start)
    notes = list(columns.incomplete)
    times: dict[int | None, dict[str, object]] = {}
    for place in dict.fromkeys(one.time for unit in columns.units for one in unit.quantities.values()):
        used = place if place is not None else next(iter(columns.counts), None)
        times[place], said = time_table(start, columns, used, given.time_unit, given.rate_hz)
        notes += [said] if said else []
    counter = _counter(start, columns, times)
    units, said_units = _units(start, columns, times, given)
    document = _document(start, columns, times, units, counter)
    return TableMapping(start, columns, document, (*notes, *said_units))


def _document(
    start: TableStart,
    columns: TableColumns,
    times: Mapping[int | None, Mapping[str, object]],
    units: Units,
    counter: Mapping[str, object],
) -> dict[str, object]:
    """The mapping: an entry for each time column."""
    tables = []
    for place, time in times.items():
        sensors = [
            {"name": one.name, **quantities}
            for one in columns.units
            if (quantities := _quantities(start, one, place, units))
        ]
        tables.append(
            {"path": start.file.name, **_dialect(start), "time": time, **counter, "sensor": sensors}
        )
    return {"format": 1, "file": tables}


def _quantities(start: TableStart, one: UnitColumns, place: int | None, units: Units) -> dict[str, object]:
    return {
        quantity: {"columns": column_names(start, held.places), "unit": units[one.name, quantity]}
        for quantity, held in one.quantities.items()
        if held.time == place
    }


def _dialect(start: TableStart) -> dict[str, object]:
    one = start.dialect
    keys: dict[str, object] = {"delimiter": one.delimiter, "decimal": one.decimal, "encoding": one.encoding}
    keys |= {"skip_rows": one.skip_rows, "skip_after_header": one.skip_after_header}
    return keys if one.missing == MISSING_MARKERS else {**keys, "missing": list(one.missing)}


def _counter(
    start: TableStart, columns: TableColumns, times: Mapping[int | None, Mapping[str, object]]
) -> dict[str, object]:
    """The key `counter` if a column beside the time counts packets without a fault."""
    if columns.counter is None or not all("column" in time for time in times.values()):
        return {}
    layout = ColumnLayout.of(start.file, start.dialect)
    try:
        values = read_columns(layout, column_names(start, [columns.counter]))[:, 0]
    except DataError:
        return {}
    counter = counter_table(start, columns.counter, values)
    return {"counter": counter} if counter else {}


def _units(
    start: TableStart,
    columns: TableColumns,
    times: Mapping[int | None, Mapping[str, object]],
    given: Given,
) -> tuple[Units, list[str]]:
    """Units of measurement: as given, as the header says, or as measured."""
    found: dict[tuple[str, Quantity], str] = {}
    open_units: dict[Quantity, list[str]] = {}
    for quantity, valid, _ in _ASK:
        known = given.of(quantity)
        if known is not None and known not in valid:
            raise DataError(
                f'{start.file}: --{quantity}-unit "{known}" is not known. Units: {", ".join(valid)}.'
            )
        for one in (one for one in columns.units if quantity in one.quantities):
            unit = known or one.quantities[quantity].measured_in
            if unit is None:
                open_units.setdefault(quantity, []).append(one.name)
            found[one.name, quantity] = unit or _HELD[quantity]
    if not open_units:
        return found, []
    held = {
        key: _HELD[key[1]] if key[0] in open_units.get(key[1], ()) else unit for key, unit in found.items()
    }
    mapping = _checked(start.file, _document(start, columns, times, held, {}))
    place, folder = start.file.name, start.file.parent
    try:
        measured, notes = _measured(place, read_mapped(mapping, folder, {}, _ROWS_TO_MEASURE), open_units)
    except UnclearError:
        measured, notes = _measured(place, read_mapped(mapping, folder, {}), open_units)
    return {**found, **measured}, notes


def _measured(
    place: str, recording: Recording, open_units: Mapping[Quantity, Sequence[str]]
) -> tuple[Units, list[str]]:
    """The units that the readings show, of the quantities and inertial units whose header says none."""
    found: dict[tuple[str, Quantity], str] = {}
    notes = []
    for quantity, _, measure in _ASK:
        if names := open_units.get(quantity):
            streams = [s for name in names if isinstance(s := recording[name], ImuStream)]
            unit, said = measure(place, streams)
            found |= {(name, quantity): unit for name in names}
            notes.append(said)
    return found, notes


def _checked(file: Path, document: Mapping[str, object]) -> CsvMapping:
    text = toml_text(document)
    return mapping_of(TomlTable(tomllib.loads(text), file, text))
