"""The least delays of a device's readings, and the line through them: offset and drift of its clock (`DeviceClock`).

A reading arrives after it was measured, never before: the delay, arrival minus the device's clock, is the offset plus
a time on the way that has a minimum. So the least delay of each few seconds gives the offset, and a robust line through
those gives the drift (lower envelope; Moon, Skelly and Towsley 1999). The mean of the delays would be late by the mean
time on the way.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import islice

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import robust_std

WINDOW_S, WINDOWS = 5.0, 240
"""The least delay is taken of each such window; the line goes through those of the last 20 minutes."""
FORGET_S = 300.0
"""A window counts e times less after this time: crystals change their rate as they warm up."""
DRIFT_STD = 50e-6
"""Before a line is known: the drift of quartz clocks, and of the crystals of small units when warm."""
KNOWN_DRIFT_STD, KNOWN_WINDOWS = 10e-6, 12
"""How well a clock that starts again keeps its drift, if so many windows determined it."""
LEAST_DELAY_STD_S = 5e-4
CHANGED_S = 0.02
"""If the newest windows are all off the line by more, the way or the clock has changed, and the older ones are left."""
CHANGED_LATE, CHANGED_EARLY = 4, 2
"""So many windows show it. A reading can be late by chance, but it cannot be early."""
_ROUNDS = 8


class Envelope:
    """Offset and drift from the delays of one segment, in which the clock was not set."""

    def __init__(self, drift_std: float = DRIFT_STD) -> None:
        self._prior = (0.0, drift_std)
        self._least: deque[tuple[float, float]] = deque(maxlen=WINDOWS)
        self._window: tuple[float, float, float] | None = None
        self._line = (0.0, 0.0, 0.0)

    @property
    def drift(self) -> float:
        """By how much the device's clock is slow, as a ratio: 50e-6 is 50 ppm."""
        return self._line[2]

    def offset_s(self, arrival_s: float) -> float:
        """The line at a time: what is to be added to the device's stamps, s."""
        at, offset, drift = self._line
        return offset + drift * (arrival_s - at)

    def begin(self, delays: Iterable[tuple[float, float]]) -> None:
        """Starts a segment with its first readings: arrival and delay, s. The crystal keeps its drift."""
        if len(self._least) >= KNOWN_WINDOWS:
            self._prior = (self.drift, KNOWN_DRIFT_STD)
        self._least.clear()
        self._window = None
        self._line = (0.0, np.inf, 0.0)
        for arrival_s, delay_s in delays:
            self.see(arrival_s, delay_s)

    def see(self, arrival_s: float, delay_s: float) -> None:
        """Takes the delay into its window; a window that has ended gives a point of the line."""
        if not self._least and delay_s < self.offset_s(arrival_s):
            self._line = (arrival_s, delay_s, self._prior[0])
        if self._window is None:
            self._window = (arrival_s, arrival_s, delay_s)
            return
        began_s, at_s, least_s = self._window
        if arrival_s < began_s + WINDOW_S:
            if delay_s < least_s:
                self._window = (began_s, arrival_s, delay_s)
            return
        self._window = (arrival_s, arrival_s, delay_s)
        self._least.append((at_s, least_s))
        self._forget_if_changed()
        self._line = line(np.array(self._least), self._prior)

    def _forget_if_changed(self) -> None:
        for count, sign in ((CHANGED_LATE, 1.0), (CHANGED_EARLY, -1.0)):
            newest = list(islice(reversed(self._least), count))
            if len(self._least) > count and all(
                sign * (least_s - self.offset_s(at_s)) > CHANGED_S for at_s, least_s in newest
            ):
                self._least.clear()
                self._least.extend(reversed(newest))
                return


def line(least: Floats, prior: tuple[float, float] = (0.0, DRIFT_STD)) -> tuple[float, float, float]:
    """The line through the least delays of windows: a time, the offset there (s), and the drift.

    Args:
        least: (N, 2) arrival s, least delay s, by time.
        prior: of the drift: mean and standard deviation.

    Points above the line weigh less: a window may have had no fast reading. The prior has the tails of Student's t
    with one degree of freedom, so that a clearly larger drift is accepted.
    """
    newest = np.exp((least[:, 0] - least[-1, 0]) / FORGET_S)
    middle = float(np.average(least[:, 0], weights=newest))
    late, delay = least[:, 0] - middle, least[:, 1]
    weight = newest * LEAST_DELAY_STD_S**-2
    usual, usual_std = prior
    offset, drift = 0.0, usual
    for _ in range(_ROUNDS):
        precision = 2.0 / (2.0 * usual_std**2 + (drift - usual) ** 2)
        total, first = weight.sum(), weight @ late
        normal = np.array([[total, first], [first, weight @ late**2 + precision]])
        right = [weight @ delay, weight @ (late * delay) + usual * precision]
        offset, drift = (float(x) for x in np.linalg.solve(normal, right))
        off = delay - offset - drift * late
        std = max(robust_std(off), LEAST_DELAY_STD_S)
        weight = newest / (1.0 + (np.maximum(off, 0.0) / std) ** 2) / std**2
    return middle, offset, drift
