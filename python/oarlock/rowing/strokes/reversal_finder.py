"""Finds the reversals of a signal reading by reading, for `find_strokes` and `LiveStrokes`."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from oarlock.rowing.strokes.reversals import Reversal, edge_reversal, fit_reversal, needed_until
from oarlock.storage.arrays import Floats

_KEPT_S = 4.0
_LOST_S = 1.2
_STILL_S = 0.5
_SURE_STD_S = 0.02
_LEAST_STANDSTILL_STD_S = 0.05


@dataclass
class ReversalFinder:
    """Alternating minima and maxima of one signal, at least `least` apart; a minimum is a catch, a maximum a finish.

    A reversal is published when the signal has come back by a tenth of `least` and the fit has both its sides. Should
    the signal pass it again before it has come back by all of `least`, it was none: another is published in its place.

    Args:
        least: smallest movement that counts, in the signal's unit.
        rests: kind of reversal ("low", "high" or "") at which the signal usually stands still for a while, as the seat
            does with legs down; there the reversal is where it leaves (low) or arrives (high).
        segment: counts silences that broke the signal in two.
    """

    least: float
    rests: str = ""
    segment: int = 0
    rising: bool | None = None
    _readings: deque[tuple[float, float]] = field(default_factory=deque)
    _low: tuple[float, float] | None = None
    _high: tuple[float, float] | None = None
    _published: bool = False
    _turned_s: float = -np.inf

    def step(self, time_s: float, value: float) -> list[Reversal]:
        """Return completed reversals; one that replaces the last published has the same kind (`high`)."""
        if np.isnan(value):
            return []
        if self._readings and time_s - self._readings[-1][0] > _LOST_S:
            self.restart()
        self._readings.append((time_s, value))
        while time_s - self._readings[0][0] > _KEPT_S:
            self._readings.popleft()
        self._follow(time_s, value)
        return self._turned(time_s, value)

    def restart(self) -> None:
        """Reset the search after a gap in the readings."""
        self.segment += 1
        self.rising, self._low, self._high, self._published = None, None, None, False
        self._readings.clear()

    def finish(self) -> list[Reversal]:
        """The reversal at the end of the readings, if they pass it."""
        extreme = self._extreme
        if self._published or extreme is None or self.rising is None:
            return []
        found = self._fit(extreme)
        sure = found is not None and found.time_std_s < _SURE_STD_S and found.time_s <= self._readings[-1][0]
        return [found] if found is not None and sure else []

    @property
    def _extreme(self) -> tuple[float, float] | None:
        return self._high if self.rising else self._low

    def _follow(self, time_s: float, value: float) -> None:
        """Extremes since the last reversal."""
        if self._low is None or self._high is None:
            self._low = self._high = (time_s, value)
            return
        if self.rising is not False and value > self._high[1]:
            self._high, self._published = (time_s, value), False
        if self.rising is not True and value < self._low[1]:
            self._low, self._published = (time_s, value), False

    def _turned(self, time_s: float, value: float) -> list[Reversal]:
        assert self._low is not None and self._high is not None
        if self.rising is None:
            return self._first()
        extreme = self._high if self.rising else self._low
        back = abs(value - extreme[1])
        found = []
        if not self._published and back >= self.least / 10.0 and self._moved_enough():
            found = self._publish(time_s, extreme)
        if back >= self.least:
            self._turn(time_s, value)
        return found

    def _moved_enough(self) -> bool:
        assert self._low is not None and self._high is not None
        return self._high[1] - self._low[1] >= self.least

    def _publish(self, time_s: float, extreme: tuple[float, float]) -> list[Reversal]:
        times, values = self._arrays()
        rests = self.rests == ("high" if self.rising else "low")
        within = np.abs(values - extreme[1]) <= self.least / (15.0 if rests else 30.0)
        near = times[within & (times >= self._turned_s)]
        found = None
        if len(near) and near[-1] - near[0] <= _STILL_S and not rests:
            if time_s < needed_until(times, values, extreme[0], self._reach):
                return []
            found = self._fit(extreme)
            if found is not None and time_s < needed_until(times, values, found.time_s, self._reach):
                return []
        self._published = True
        return [self._standstill(extreme, near) if found is None else found]

    def _first(self) -> list[Reversal]:
        """The direction is known once the signal has moved; the extreme before may lie before the first reading."""
        assert self._low is not None and self._high is not None
        if self._high[1] - self._low[1] < self.least:
            return []
        self.rising = self._high[0] > self._low[0]
        before = self._low if self.rising else self._high
        times, values = self._arrays()
        found = fit_reversal(times, values, before[0], not self.rising, self._reach)
        edge = before[0] - self._readings[0][0] < 0.06
        if found is None and edge:
            found = edge_reversal(times, values, not self.rising, self._reach)
        elif found is None:
            found = Reversal(not self.rising, before[0], 0.1, before[1], self.least / 30.0, np.nan)
        return [] if found is None else [found]

    def _turn(self, time_s: float, value: float) -> None:
        self.rising = not self.rising
        if self.rising:
            self._high = (time_s, value)
        else:
            self._low = (time_s, value)
        self._published, self._turned_s = False, time_s

    @property
    def _reach(self) -> float:
        return 0.27 * self.least

    def _arrays(self) -> tuple[Floats, Floats]:
        flat = np.fromiter(chain.from_iterable(self._readings), np.float64, 2 * len(self._readings))
        times, values = flat.reshape(-1, 2).T
        return times, values

    def _fit(self, extreme: tuple[float, float]) -> Reversal | None:
        times, values = self._arrays()
        return fit_reversal(times, values, extreme[0], bool(self.rising), self._reach)

    def _standstill(self, extreme: tuple[float, float], near: Floats) -> Reversal:
        """The signal stood still at its extreme: a drive begins where it leaves, a drive ends where it arrives."""
        if len(near) == 0:
            return Reversal(bool(self.rising), extreme[0], 0.5, extreme[1], self.least / 10.0, np.nan)
        std = max(_LEAST_STANDSTILL_STD_S, 0.1 * float(near[-1] - near[0]))
        at = float(near[0] if self.rising else near[-1])
        return Reversal(bool(self.rising), at, std, extreme[1], self.least / 60.0, np.nan)
