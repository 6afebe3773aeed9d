"""The time column of a CSV file: its unit, the rate of a count of samples, wrapping. For the CSV reader."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from oarlock.formats.counters import probable_modulus, unwrapped
from oarlock.formats.csv_mapping import FileMapping
from oarlock.formats.time_units import recognised_unit
from oarlock.formats.times import COUNTED, SAMPLES, Stamps, relative_stamps
from oarlock.storage.arrays import Floats
from oarlock.storage.delimited import Batch, ColumnLayout, numbers
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_text

_RATE = re.compile(r"(?<![\d.,])(\d+(?:[.,]\d+)?)\s*hz\b", re.IGNORECASE)


@dataclass(frozen=True)
class TimeUnit:
    """How the time column of a file is read.

    Args:
        unit: one of `TIME_UNITS`.
        tick_s: length of a tick or a sample, s; 1 for the other units.
        said: what was recognised and why, one sentence each; empty if the mapping file says everything.
    """

    unit: str
    tick_s: float
    said: tuple[str, ...]

    @property
    def counted(self) -> bool:
        """True for numbers that count from an unknown start."""
        return self.unit in COUNTED


def time_unit(layout: ColumnLayout, entry: FileMapping) -> TimeUnit:
    """The unit of a file's time column, as the mapping file says or recognised.

    Raises:
        DataError: the unit or the rate is not clear; the text lists the choices.
    """
    assert entry.time_column is not None
    index = layout.index(entry.time_column)
    unit, said = entry.time_unit, []
    if unit is None:
        unit, sentence = _recognised(layout, index)
        said.append(sentence)
    tick_s = entry.tick_s
    if unit == SAMPLES and tick_s is None:
        rate_hz = _rate_above_header(layout, entry)
        said.append(
            f"{layout.file.name}: a count of samples at {rate_hz:g} Hz, because a line above the header says so."
        )
        tick_s = 1.0 / rate_hz
    return TimeUnit(unit, 1.0 if tick_s is None else tick_s, tuple(said))


def counted_stamps(
    count: Floats, found: TimeUnit, entry: FileMapping, places: Sequence[str]
) -> tuple[Stamps, tuple[str, ...]]:
    """Time stamps of a count, and a sentence if it wraps and the mapping file does not say so.

    Only a count of samples is unwrapped unasked: its steps are known to be one.
    """
    wraps_at = entry.time_wraps_at
    said: tuple[str, ...] = ()
    if wraps_at is None and found.unit == SAMPLES:
        wraps_at = probable_modulus(count)
        if wraps_at is not None:
            said = (f"{places[0]}: the count restarts at {wraps_at:.0f}, and continues.",)
    if wraps_at is not None:
        count = unwrapped(count, wraps_at, places)
    return relative_stamps(count, found.unit, found.tick_s), said


def _recognised(layout: ColumnLayout, index: int) -> tuple[str, str]:
    batch = next(layout.batches([index]), None)
    if batch is None:
        raise DataError(f"{layout.file}: has no rows of data")
    header = layout.names[index] if layout.names else ""
    place = f"{layout.file.name}, {layout.label(index)}"
    return recognised_unit(header, batch.cells[0], _as_numbers(layout, batch, index), place)


def _as_numbers(layout: ColumnLayout, batch: Batch, index: int) -> Floats | None:
    try:
        values = numbers(layout, batch, 0, index)
    except DataError:
        return None
    present = values[np.isfinite(values)]
    return present if present.size else None


def rates_named(lines: Iterable[str]) -> set[float]:
    """The rates that lines of text name, such as "Rate: 100 Hz", in Hz."""
    return {float(text.replace(",", ".")) for line in lines for text in _RATE.findall(line)}


def _rate_above_header(layout: ColumnLayout, entry: FileMapping) -> float:
    """The one rate that the skipped lines name, Hz."""
    with open_text(layout.file, layout.dialect.encoding) as file:
        above = list(islice(file, layout.dialect.skip_rows))
    found = rates_named(above)
    if len(found) == 1 and (rate_hz := found.pop()) > 0.0:
        return rate_hz
    listed = f"they name {', '.join(f'{r:g} Hz' for r in sorted(found))}" if found else "they name none"
    raise DataError(
        f"{entry.where}: the rate of the count is not known: no single rate stands in the {layout.dialect.skip_rows} "
        f"skipped lines above the header of {layout.file.name} ({listed}). Give time.rate_hz."
    )
