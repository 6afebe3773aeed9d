"""Recognises the unit of a time column from its header and its values, for the CSV reader. Never guesses."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from oarlock.formats.times import CLOCK, ISO, RELATIVE, SAMPLES, TICKS, TIME_UNITS, is_clock_time, is_iso_time
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import FIRST_S, LAST_S, moment_text
from oarlock.storage.errors import DataError

_LONGEST_S = 365 * 86_400.0
"""No device counts longer than this from its start."""
_RATES_HZ = (0.5, 5000.0)
"""Rates at which sensors are read; a unit that implies another one is not considered."""
_TICK_S, _TICK_RATES_HZ = 1e-4, (5.0, 5000.0)
"""The usual tick of devices whose count is in no unit (SampleTimeFine of MT Manager)."""
_NAMES = MappingProxyType(
    {
        "s": "s|sec|secs|seconds?|sek|sekunden",
        "ms": "ms|msec|millis|milliseconds?",
        "us": "us|µs|μs|usec|micros|microseconds?",
        "ns": "ns|nsec|nanos|nanoseconds?",
    }
)


@dataclass(frozen=True)
class TimeUnitCandidate:
    """A unit that a time column may have.

    Args:
        unit: one of `TIME_UNITS`.
        keys: how the mapping file says it.
        meaning: the rate, or the date, that follows.
    """

    unit: str
    keys: str
    meaning: str


def recognised_unit(header: str, cells: Sequence[str], values: Floats | None, place: str) -> tuple[str, str]:
    """The unit of a time column, and a sentence that says what was recognised and why.

    Args:
        header: name of the column; empty if there is none.
        cells: the first texts of the column.
        values: (T,) the same as numbers; None if they are no numbers.
        place: file and column, for the sentence and for errors.

    Raises:
        DataError: several units are possible, or none. The text lists the choices.
    """
    if values is None:
        return _from_texts(cells, place)
    scale = _scale_in(header)
    found = list(_readings(values, scale))
    if len(found) != 1 or found[0].unit in (TICKS, SAMPLES):
        raise DataError(_unclear(place, values, found, scale))
    reason = f'the header says "{scale}"' if scale else "of its values"
    because = f"because {reason}" if scale else f"because {reason} no other unit is plausible"
    return found[0].unit, f"{place}: read as {found[0].keys} ({found[0].meaning}), {because}."


def possible_units(header: str, values: Floats) -> list[TimeUnitCandidate]:
    """The units that a time column of numbers may have: those that give a plausible rate and date.

    Args:
        header: name of the column; empty if there is none.
        values: (T,) finite numbers of the column.
    """
    return list(_readings(values, _scale_in(header)))


def _from_texts(cells: Sequence[str], place: str) -> tuple[str, str]:
    for unit, fits in ((CLOCK, is_clock_time), (ISO, is_iso_time)):
        if all(fits(cell) for cell in cells):
            return unit, f'{place}: read as unit = "{unit}", because all values are written so.'
    odd = next((c for c in cells if not is_clock_time(c) and not is_iso_time(c)), cells[0])
    raise DataError(
        f'{place}: the unit of time is not clear: "{odd}" is not a number, a clock time such as 14:03:27.250 or an '
        "ISO date-time such as 2024-05-01T14:03:27.250Z"
    )


def _scale_in(header: str) -> str:
    """The unit in a column's name, such as "Time [ms]" or "timestamp_us"; empty if there is none."""
    words = re.split(r"[\s_\[\](){}/.,:;-]+", header.casefold())
    found = [unit for unit, names in _NAMES.items() if any(re.fullmatch(names, word) for word in words)]
    return found[0] if len(found) == 1 else ""


def _readings(values: Floats, scale: str) -> Iterator[TimeUnitCandidate]:
    """The units that give a plausible rate and date; with a unit in the header only that one."""
    step = float(np.median(np.diff(values))) if len(values) > 1 else float("nan")
    low, high = float(values.min()), float(values.max())
    for unit, per_s in RELATIVE.items():
        if scale not in ("", unit):
            continue
        rate_hz = per_s / step if step > 0.0 else float("nan")
        if low / per_s >= FIRST_S and high / per_s <= LAST_S:
            if np.isnan(rate_hz) or _within(rate_hz, _RATES_HZ):
                when = moment_text("1970-01-01T00:00:00Z", low / per_s)
                yield TimeUnitCandidate(
                    f"epoch_{unit}", f'unit = "epoch_{unit}"', f"from {when}, {_rate(rate_hz)}"
                )
        elif high / per_s < _LONGEST_S and _within(rate_hz, _RATES_HZ):
            yield TimeUnitCandidate(unit, f'unit = "{unit}"', _rate(rate_hz))
    if not scale and _whole(values):
        yield from _counts(step, high)


def _counts(step: float, high: float) -> Iterator[TimeUnitCandidate]:
    rate_hz = 1.0 / (step * _TICK_S) if step > 0.0 else float("nan")
    if _within(rate_hz, _TICK_RATES_HZ) and high * _TICK_S < _LONGEST_S:
        yield TimeUnitCandidate(TICKS, f'unit = "{TICKS}", tick_s = {_TICK_S:g}', _rate(rate_hz))
    if step == 1.0 and high < 2.0**32:
        yield TimeUnitCandidate(SAMPLES, f'unit = "{SAMPLES}", rate_hz = ...', "a count of samples")


def _within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


def _whole(values: Floats) -> bool:
    return bool((values == np.round(values)).all())


def _rate(rate_hz: float) -> str:
    return "one sample" if np.isnan(rate_hz) else f"{rate_hz:.4g} Hz"


def _unclear(place: str, values: Floats, found: Sequence[TimeUnitCandidate], scale: str) -> str:
    step = f" in steps of {np.median(np.diff(values)):.6g}" if len(values) > 1 else ""
    says = f', and the header says "{scale}"' if scale else ""
    begin = f"{place}: the unit of time is not clear: the column begins at {values[0]:.15g}{step}{says}. "
    if not found:
        return (
            f"{begin}No unit gives a plausible rate or date. Give time.unit: one of {', '.join(TIME_UNITS)}."
        )
    choices = ", or ".join(f"{one.keys} ({one.meaning})" for one in found)
    return f"{begin}Add to time in the mapping file one of: {choices}."
