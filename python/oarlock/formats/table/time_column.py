"""The time column of a table without a mapping file: its unit, a count of samples, or rows at a known rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock.formats.choices import UnclearError
from oarlock.formats.counters import probable_modulus
from oarlock.formats.csv_time import rates_named
from oarlock.formats.table.columns import TableColumns
from oarlock.formats.table.layout import TableStart
from oarlock.formats.time_units import possible_units, recognised_unit
from oarlock.formats.times import (
    COUNTED,
    SAMPLES,
    TICKS,
    TIME_UNITS,
    on_one_axis,
    parsed_stamps,
    plain_time_unit,
)
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import moment_text
from oarlock.storage.errors import DataError

_TICK_S = 1e-4
_MOST_HZ = 10_000.0


def time_table(
    start: TableStart, columns: TableColumns, place: int | None, unit: str | None, rate_hz: float | None
) -> tuple[dict[str, object], str]:
    """The table `time` of a mapping, and a sentence on what was recognised.

    Args:
        start: the table.
        columns: its columns.
        place: position of the time column; None if there is none.
        unit: of the time column, if the caller knows it.
        rate_hz: of the rows, if the caller knows it.

    Raises:
        UnclearError: the unit or the rate is not clear.
        DataError: `unit` or `rate_hz` is not possible.
    """
    if unit is None and (place is None or place in columns.counts or rate_hz is not None):
        return _counted(start, rate_hz, place if place in columns.counts else None)
    if place is None:
        raise DataError(f"{start.file}: --time-unit is given, but no column is a time. Give --rate-hz.")
    cells = [row[place] for row in start.rows]
    values = _numbers(cells, start.dialect.decimal)
    column = _column(start, place)
    if unit is not None:
        return _given(start, column, unit, rate_hz)
    where = f'{start.file.name}, column "{start.names[place]}"'
    if values is not None:
        found = possible_units(start.names[place], values)
        if len(found) > 1 or (found and found[0].unit in (TICKS, SAMPLES)):
            raise UnclearError(
                f"{where}: the unit of time is not clear. Give --time-unit: "
                + ", or ".join(f"{one.unit} ({one.meaning})" for one in found),
                "time_unit",
                {one.unit: one.meaning for one in found},
            )
    name, sentence = recognised_unit(start.names[place], cells, values, where)
    return {"column": column, "unit": name}, sentence


def first_moment(start: TableStart, columns: TableColumns) -> str:
    """The moment of the first row as text; empty if the time column has no date and no time of day."""
    for place in columns.times[:1]:
        try:
            time, _ = time_table(start, columns, place, None, None)
            if time["unit"] not in COUNTED:
                stamps = parsed_stamps([start.rows[0][place]], [str(start.file)], str(time["unit"]))
                _, clock = on_one_axis([stamps], [str(start.file)])
                return moment_text(str(clock.get("zero")), 0.0)
        except DataError:
            continue
    return ""


def _given(
    start: TableStart, column: str | int, unit: str, rate_hz: float | None
) -> tuple[dict[str, object], str]:
    plain = plain_time_unit(unit)
    if plain not in TIME_UNITS:
        raise DataError(f'{start.file}: --time-unit "{unit}" is not known. Units: {", ".join(TIME_UNITS)}.')
    if plain == SAMPLES:
        return _counted(start, rate_hz, None)
    extra = {"tick_s": _TICK_S} if plain == TICKS else {}
    return {"column": column, "unit": plain, **extra}, ""


def _counted(start: TableStart, rate_hz: float | None, place: int | None) -> tuple[dict[str, object], str]:
    """Samples at a known rate: counted by a column, or row by row, where a missing one is not noticed."""
    if rate_hz is None:
        rates = rates_named(start.above)
        if len(rates) != 1:
            raise UnclearError(
                f"{start.file}: has no column of time stamps, and no line above the header names one rate. "
                "Give --rate-hz, the rows in a second.",
                "rate_hz",
                {},
            )
        rate_hz = rates.pop()
    if not 0.0 < rate_hz <= _MOST_HZ:
        raise DataError(
            f"{start.file}: --rate-hz is {rate_hz:g}; expected rows in a second, up to {_MOST_HZ:g}"
        )
    keys: dict[str, object] = {"unit": SAMPLES, "rate_hz": rate_hz}
    if place is None:
        return keys, f"{start.file.name}: rows were counted at {rate_hz:g} Hz."
    said = f'{start.file.name}: column "{start.names[place]}" counts samples at {rate_hz:g} Hz.'
    return {"column": _column(start, place), **keys}, said


def counter_table(start: TableStart, place: int, values: Floats) -> dict[str, object]:
    """The table `counter` of a mapping; empty if the column does not count up.

    Args:
        start: the table.
        place: position of the column.
        values: (T,) its values.
    """
    if len(values) < 3 or np.isnan(values).any() or (values != np.round(values)).any():
        return {}
    modulus = probable_modulus(values)
    backwards = np.diff(values) <= 0.0
    if (modulus is None and backwards.any()) or (values < 0.0).any():
        return {}
    return {"column": _column(start, place), **({"wraps_at": modulus} if modulus else {})}


def _column(start: TableStart, place: int) -> str | int:
    """How a mapping names a column: by its name, or by its number if the name is not unique."""
    name = start.names[place]
    return name if name and start.names.count(name) == 1 else place + 1


def column_names(start: TableStart, places: Sequence[int]) -> list[str | int]:
    """How a mapping names columns."""
    return [_column(start, place) for place in places]


def _numbers(cells: Sequence[str], decimal: str) -> Floats | None:
    """The cells as numbers, without trailing empty ones; None if one is no number."""
    texts = [cell.strip().replace(",", ".") if decimal == "," else cell.strip() for cell in cells]
    try:
        values = np.array([float(text) for text in texts if text])
    except ValueError:
        return None
    return values if values.size and np.isfinite(values).all() else None
