"""A device's clock against this machine's, from arrivals: offset and drift, used at once, slewed, never stepped.

A reading arrives after it was measured, never before: the delay, arrival minus the device's clock, is the offset plus
a time on the way that has a minimum. So the least delay of each few seconds tells the offset, and a robust line through
those tells the drift (lower envelope; Moon, Skelly and Towsley 1999). The mean of the delays would be late by the mean
time on the way.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from oarlock.storage.array_gate import FloatArray

SETTLE_S = 2.0
"""The least delay of so much time is the first offset."""
WINDOW_S, WINDOWS = 5.0, 240
"""The least delay is taken of each such window; the line goes through those of the last 20 minutes."""
SLEW = 1e-3
"""The offset in use moves by this much a second at most: far above any drift, far below what a movement shows."""
RESTART_S = 0.25
"""A clock that is off by more was set or started again."""
DRIFT_STD = 50e-6
"""Before a line is known: the drift of quartz clocks, and of the crystals of small units when warm."""
LEAST_DELAY_STD_S = 5e-4
_ROUNDS = 8


@dataclass
class DeviceClock:
    """Turns a device's stamps into seconds of this machine; the same readings give the same bits."""

    restarts: int = 0
    """How often the device's clock was set or started again."""
    _settling: tuple[float, float] | None = None
    _offset_s: float | None = None
    _used_at_s: float = 0.0
    _last_clock_s: float = -np.inf
    _window: tuple[float, float, float] | None = None
    _least: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=WINDOWS))
    _line: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def offset_s(self) -> float | None:
        """What is added to the device's stamps now, s; None until the clock has settled."""
        return self._offset_s

    @property
    def drift(self) -> float:
        """By how much the device's clock is slow, as a ratio: 50e-6 is 50 ppm."""
        return self._line[2]

    def time_s(self, clock_s: float, arrival_s: float) -> float | None:
        """The time of a reading by this machine's clock, s; None in the first two seconds and after a restart.

        Args:
            clock_s: the device's stamp, s, unwrapped.
            arrival_s: when the reading was received, s, by this machine's monotonic clock.
        """
        delay_s = arrival_s - clock_s
        if self._is_restarted(clock_s, delay_s):
            self._restart()
        self._last_clock_s = max(clock_s, self._last_clock_s)
        if self._offset_s is None and not self._settled(arrival_s, delay_s):
            return None
        self._see(arrival_s, delay_s)
        self._slew(arrival_s)
        return None if self._offset_s is None else clock_s + self._offset_s

    def _is_restarted(self, clock_s: float, delay_s: float) -> bool:
        known_s = self._offset_s if self._offset_s is not None else self._settling and self._settling[1]
        if known_s is None:
            return False
        return clock_s < self._last_clock_s - 1.0 or delay_s < known_s - RESTART_S

    def _restart(self) -> None:
        self.restarts += 1
        self._settling = self._offset_s = self._window = None
        self._last_clock_s = -np.inf
        self._least.clear()

    def _settled(self, arrival_s: float, delay_s: float) -> bool:
        """Takes part in the first offset, and says whether it is known."""
        if self._settling is None:
            self._settling = (arrival_s, delay_s)
        began_s, least_s = self._settling
        self._settling = (began_s, min(least_s, delay_s))
        if arrival_s < began_s + SETTLE_S:
            return False
        self._offset_s, self._used_at_s = self._settling[1], arrival_s
        # The drift of an earlier segment is that of the same crystal.
        self._line = (arrival_s, self._offset_s, self._line[2])
        self._settling = None
        return True

    def _see(self, arrival_s: float, delay_s: float) -> None:
        """Takes the delay into its window; a window that has ended gives a point of the line."""
        if self._window is None:
            self._window = (arrival_s, arrival_s, delay_s)
            return
        began_s, at_s, least_s = self._window
        if arrival_s < began_s + WINDOW_S:
            if delay_s < least_s:
                self._window = (began_s, arrival_s, delay_s)
            return
        self._window = (arrival_s, arrival_s, delay_s)
        at, offset, drift = self._line
        if least_s > offset + drift * (at_s - at) + RESTART_S and len(self._least) > 0:
            # Even the fastest reading of this window is late: the device paused its clock.
            self._restart()
            return
        self._least.append((at_s, least_s))
        self._line = envelope(np.array(self._least))

    def _slew(self, arrival_s: float) -> None:
        if self._offset_s is None:
            return
        at, offset, drift = self._line
        target_s = offset + drift * (arrival_s - at)
        room_s = SLEW * max(arrival_s - self._used_at_s, 0.0)
        self._offset_s += float(np.clip(target_s - self._offset_s, -room_s, room_s))
        self._used_at_s = max(arrival_s, self._used_at_s)


def envelope(least: FloatArray) -> tuple[float, float, float]:
    """The line through the least delays of windows: a time, the offset there (s), and the drift.

    Args:
        least: (N, 2) arrival s, least delay s.

    Points above the line weigh less: a window may have had no fast reading. Drift has a prior of `DRIFT_STD`.
    """
    middle = float(least[:, 0].mean())
    late, delay = least[:, 0] - middle, least[:, 1]
    weight = np.full(len(least), LEAST_DELAY_STD_S**-2)
    offset = drift = 0.0
    for _ in range(_ROUNDS):
        total, first = weight.sum(), weight @ late
        normal = np.array([[total, first], [first, weight @ late**2 + DRIFT_STD**-2]])
        offset, drift = (float(x) for x in np.linalg.solve(normal, [weight @ delay, weight @ (late * delay)]))
        off = delay - offset - drift * late
        std = max(float(np.median(np.abs(off))) * 1.4826, LEAST_DELAY_STD_S)
        weight = 1.0 / (1.0 + (np.maximum(off, 0.0) / std) ** 2) / std**2
    return middle, offset, drift
