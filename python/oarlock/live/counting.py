"""A packet counter as a clock: even spacing for devices that count their readings and send no time."""

from __future__ import annotations

from dataclasses import dataclass

SURE_S, SAME_SHARE = 10.0, 5e-3
"""Over so much time the counter's pace shows whether it is the rate, to this share."""
RATE_STD = 3e-3
"""How far the true rate may be from the one in the rig file, as a standard deviation."""


@dataclass
class Counting:
    """Turns counts into seconds, once their pace agrees with a known rate.

    Args:
        rate_hz: of the readings.
    """

    rate_hz: float
    _first: tuple[int, float] | None = None
    _is_clock: bool | None = None

    def clock_s(self, count: int, arrival_s: float) -> float | None:
        """The stamp of a reading, s; None if the counter is no clock, or it is not known yet."""
        if self._first is None:
            self._first = (count, arrival_s)
        if self._is_clock is None and arrival_s - self._first[1] >= SURE_S:
            pace_hz = (count - self._first[0]) / (arrival_s - self._first[1])
            self._is_clock = abs(pace_hz / self.rate_hz - 1.0) < SAME_SHARE
        return count / self.rate_hz if self._is_clock else None
