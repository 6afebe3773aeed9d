"""A clock of whole milliseconds made finer by the count of samples, for decoders whose wire carries both."""

from __future__ import annotations

HALF_COUNT_S = 5e-4
"""Rounding to milliseconds."""


class MillisecondClock:
    """Time of samples at equal intervals: it goes on by their mean interval, within the rounding of the stamps.

    Whole milliseconds as they are would cost 0.5 ms: at 200 deg/s 0.1 deg.
    """

    def __init__(self) -> None:
        self._first: tuple[int, float] | None = None
        self._last: tuple[int, float] | None = None

    def time_s(self, count: int, stamp_s: float) -> float:
        """The time of a sample, s.

        Args:
            count: of samples, unwrapped.
            stamp_s: its time in whole milliseconds, s, unwrapped.
        """
        found = stamp_s
        if self._first is None or self._last is None or stamp_s < self._first[1] or count < self._first[0]:
            self._first = (count, stamp_s)
        elif count > self._first[0]:
            interval_s = (stamp_s - self._first[1]) / (count - self._first[0])
            going_s = self._last[1] + interval_s * (count - self._last[0])
            found = min(max(going_s, stamp_s - HALF_COUNT_S), stamp_s + HALF_COUNT_S)
        self._last = (count, found)
        return found
