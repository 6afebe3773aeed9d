"""`SampleClock`: time stamps of units that count packets and ticks, which both wrap. For readers of Xsens devices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.formats.choices import UnclearError
from oarlock.formats.counters import Lost, lost_packets, unwrapped
from oarlock.formats.devices.exported_table import Columns
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

COUNTER, TICKS = "PacketCounter", "SampleTimeFine"


@dataclass(frozen=True)
class Stamped:
    """The time stamps of one unit.

    Args:
        time_s: (T,) s.
        lost: lost packets by its counter.
    """

    time_s: Floats
    lost: Lost


@dataclass(frozen=True)
class SampleClock:
    """How a maker's units count.

    Args:
        counter_wraps_at: modulus of `COUNTER`.
        ticks_wrap_at: modulus of `TICKS`.
        tick_rate_hz: ticks in a second.
        rate_hint: where the rate of the counter stands and what to do without it, for the error.
        rate_option: keyword of the reader that gives the rate; empty for none.
    """

    counter_wraps_at: float
    ticks_wrap_at: float
    tick_rate_hz: float
    rate_hint: str
    rate_option: str = ""

    def stamped(self, units: Sequence[Columns], rates_hz: Sequence[float | None]) -> list[Stamped]:
        """Time stamps of units that share one clock: ticks, or where no unit has any, packets at their rates.

        Ticks count from an unknown start; of packets the earliest is at 0 s.

        Raises:
            DataError: a count is missing or not in order, or only some units have ticks.
            UnclearError: a rate is not known and the reader has an option for it.
        """
        counts = _aligned([self._count(unit) for unit in units], self.counter_wraps_at)
        times = self._times(units, counts, rates_hz)
        return [
            Stamped(time_s, lost_packets(count, time_s, unit.places(COUNTER)))
            for unit, count, time_s in zip(units, counts, times, strict=True)
        ]

    def _count(self, unit: Columns) -> Floats:
        return _unwrapped(unit, COUNTER, "counter", self.counter_wraps_at)

    def _times(
        self, units: Sequence[Columns], counts: Sequence[Floats], rates_hz: Sequence[float | None]
    ) -> list[Floats]:
        ticking = [has_ticks(unit) for unit in units]
        if not any(ticking):
            zero = min(float(count[0]) for count in counts)
            rates = [self._rate_hz(unit, rate) for unit, rate in zip(units, rates_hz, strict=True)]
            if len(set(rates)) > 1:
                raise DataError(
                    f"{units[0].layout.file.parent}: its units count packets at different rates "
                    f"({', '.join(f'{rate:g}' for rate in sorted(set(rates)))} Hz), so their counts have no common "
                    "start. Import them alone."
                )
            return [(count - zero) / rate for count, rate in zip(counts, rates, strict=True)]
        if not all(ticking):
            empty, filled = (units[ticking.index(has)].layout.file for has in (False, True))
            raise DataError(
                f"{empty}: {TICKS} is empty, that of {filled.name} is filled. They have no common clock; import them "
                "alone."
            )
        ticks = [_unwrapped(unit, TICKS, "time", self.ticks_wrap_at) for unit in units]
        times = [tick / self.tick_rate_hz for tick in _aligned(ticks, self.ticks_wrap_at)]
        for unit, time_s in zip(units, times, strict=True):
            unit.check_increasing(time_s, TICKS, " If the unit was restarted, split the file here.")
        return times

    def _rate_hz(self, unit: Columns, rate_hz: float | None) -> float:
        if rate_hz is None or not 0.0 < rate_hz < float("inf"):
            said = "empty" if TICKS in unit.values else "missing"
            text = (
                f"{unit.layout.file}: the time is not known: {TICKS} is {said} and no line above the names "
                f"{self.rate_hint}"
            )
            raise UnclearError(text, self.rate_option, {}) if self.rate_option else DataError(text)
        return rate_hz


def clock_note(units: Sequence[Columns]) -> dict[str, object]:
    """For ``meta["clock"]``: what the stamps count."""
    by_ticks = has_ticks(units[0])
    return {"kind": "relative" if by_ticks else "samples", "from": TICKS if by_ticks else COUNTER}


def has_ticks(unit: Columns) -> bool:
    """True if a cell of `TICKS` is filled."""
    return TICKS in unit.values and bool(np.isfinite(unit.values[TICKS]).any())


def _unwrapped(unit: Columns, name: str, what: str, wraps_at: float) -> Floats:
    values = unit.present(name, what)
    outside = np.flatnonzero((values < 0.0) | (values >= wraps_at))
    if outside.size:
        row = int(outside[0])
        raise DataError(f"{unit.places(name)[row]}: is {values[row]:.15g}; expected 0 to {wraps_at - 1:.15g}")
    return unwrapped(values, wraps_at, unit.places(name))


def _aligned(counts: Sequence[Floats], wraps_at: float) -> list[Floats]:
    """Counts of one clock that began near each other, possibly on both sides of a wrap."""
    first = float(counts[0][0])
    return [count - wraps_at * round((float(count[0]) - first) / wraps_at) for count in counts]
