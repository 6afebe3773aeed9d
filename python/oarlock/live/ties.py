"""Devices' clocks tied to each other by the movement that all sensors measure.

The least delay of a device has the least time on its way, 1 ms by wire and up to 30 ms by radio. So clocks that are
right but for this differ by a constant, which the movement shows: `late_clocks` looks at the last 20 s, in another
process. What it finds becomes a command, so that the packets of a session repeat it, and is slewed.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.clocks.late import late_clocks
from oarlock.live.intake import DeviceState, Intake, SensorReading
from oarlock.live.lately import Lately, StreamRows
from oarlock.recording.recording import Recording

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration

WINDOW_S = 20.0
EARLY_EVERY_S, EVERY_S = 20.0, 120.0
"""A look takes 3 to 5 s of a core. There is one for each window until no clock moves by `NEAR_S`, then fewer."""
NEAR_S = 2e-3
KNOWN_STD_S = 1.5e-3
"""What a look shows less well is not used: a body at rest, or a joint that moves slowly."""
MOST_S = 0.08
"""No way of a sensor's readings takes longer than another's by more; the body differs from the model then."""
LEAST_STD_S, SHARE = 5e-4, 0.1
"""Of a look: its windows share errors, and a step is exact to a tenth of itself."""
WANDER_S2_PER_S = 1e-6 / 600.0
"""A difference changes by 1 ms in ten minutes."""
TOLD_S = 1e-3
"""A smaller change is no command."""
_LEAST_ROWS = 50


@dataclass(frozen=True)
class ClockTest:
    """What is to be looked at: readings of a window, with stamps that no tie has moved.

    Args:
        rows: of each stream.
        groups: streams that a device feeds.
        late_s: ties so far, by the first stream of a group.
        calibration: with which is tracked.
    """

    rows: tuple[StreamRows, ...]
    groups: tuple[tuple[str, ...], ...]
    late_s: Mapping[str, float]
    calibration: Calibration | None


def looked(look: ClockTest, model: Model) -> dict[str, tuple[float, float]]:
    """By how much each group is late, s, and the standard deviation. It runs in another process, behind all others."""
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, 0, 15)
    recording = Recording([rows.stream() for rows in look.rows])
    return late_clocks(model, recording, look.groups, look.late_s, look.calibration)


@dataclass
class _Known:
    late_s: float
    variance_s2: float
    at_s: float
    told_s: float = 0.0


@dataclass
class Ties:
    """Gathers what a look needs, and makes commands of what it found.

    Args:
        intake: of the session.
    """

    intake: Intake
    _lately: dict[str, Lately] = field(default_factory=dict)
    _known: dict[str, _Known] = field(default_factory=dict)
    _devices: dict[str, DeviceState] = field(default_factory=dict)
    _due_s: float | None = None
    _reference: str | None = None

    def __post_init__(self) -> None:
        self._lately = {feed.stream: Lately(feed, WINDOW_S) for feed in self.intake.rig.feeds}
        self.intake.on_timed = self._see

    def _see(self, one: SensorReading) -> None:
        self._lately[one.stream].add(one.time_s, one.values)

    def look(self, now_s: float, calibration: Calibration | None) -> ClockTest | None:
        """What is to be looked at now; None if it is not time yet, or there is too little."""
        self._due_s = now_s + WINDOW_S if self._due_s is None else self._due_s
        if now_s < self._due_s:
            return None
        self._due_s = now_s + EARLY_EVERY_S
        found = {stream: own.since(now_s - WINDOW_S) for stream, own in self._lately.items()}
        rows = {stream: own for stream, own in found.items() if len(own) >= _LEAST_ROWS}
        groups = self._groups(sorted(rows))
        if len(groups) < 2:
            return None
        late_s = {name: known.late_s for name, known in self._known.items()}
        return ClockTest(tuple(rows.values()), groups, late_s, calibration)

    def _groups(self, heard: list[str]) -> tuple[tuple[str, ...], ...]:
        """Streams by device. Nothing is known of the clock of a device that has just been put in another's place."""
        groups: dict[int, list[str]] = {}
        for stream, device in self.intake.feeding().items():
            if self._devices.setdefault(stream, device) is not device:
                self._devices[stream] = device
                self._known.pop(stream, None)
            if stream in heard:
                groups.setdefault(id(device), []).append(stream)
        return tuple(tuple(sorted(streams)) for streams in groups.values())

    def commands(
        self, look: ClockTest, found: Mapping[str, tuple[float, float]], now_s: float
    ) -> list[dict[str, Any]]:
        """The ties that change by what a look found, as keys of commands.

        Clocks are compared with one that stays as it is: that which the first look determined best.
        """
        seen = {name: one for name, one in found.items() if one[1] < KNOWN_STD_S}
        if self._reference not in seen:
            self._reference = min(seen, key=lambda name: seen[name][1], default=None)
        if self._reference is None or len(seen) < 2:
            return []
        shift_s = seen[self._reference][0] - look.late_s.get(self._reference, 0.0)
        reference_std_s = seen[self._reference][1]
        moved_s = 0.0
        for name, (late_s, std_s) in seen.items():
            if name != self._reference and abs(late_s - shift_s) < MOST_S:
                moved_s = max(
                    moved_s,
                    self._learn(name, late_s - shift_s, float(np.hypot(std_s, reference_std_s)), now_s),
                )
        self._due_s = now_s + (EARLY_EVERY_S if moved_s > NEAR_S else EVERY_S)
        return list(self._told(look.groups))

    def _learn(self, name: str, late_s: float, std_s: float, now_s: float) -> float:
        """Takes a look's difference into what is known (Kalman 1960); by how much it moved, s."""
        last = self._known.get(name)
        step_s = late_s - (last.late_s if last else 0.0)
        variance = std_s**2 + LEAST_STD_S**2 + (SHARE * step_s) ** 2
        if last is None:
            self._known[name] = _Known(late_s, variance, now_s)
            return abs(step_s)
        before = last.variance_s2 + WANDER_S2_PER_S * (now_s - last.at_s)
        # What is far from the last one replaces it: a device took another way.
        gain = 1.0 if step_s**2 > 9.0 * (before + variance) else before / (before + variance)
        last.late_s += gain * step_s
        last.variance_s2 = variance if gain == 1.0 else (1.0 - gain) * before
        last.at_s = now_s
        return abs(gain * step_s)

    def _told(self, groups: tuple[tuple[str, ...], ...]) -> list[dict[str, Any]]:
        found = []
        for name in (group[0] for group in groups if group[0] in self._known):
            known = self._known[name]
            if abs(known.late_s - known.told_s) >= TOLD_S:
                known.told_s = known.late_s
                std_s = float(np.sqrt(known.variance_s2))
                found.append({"stream": name, "late_s": round(known.late_s, 6), "std_s": round(std_s, 6)})
        return found
