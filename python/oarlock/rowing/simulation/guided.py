"""A sculler who does what a guided start asks for, and then rows: for the demo and for tests of the guided start."""

from __future__ import annotations

import asyncio
import itertools
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from oarlock import Calibration, Model, Recording
from oarlock.calibration import SessionPlan, default_plan
from oarlock.live.simulated_devices import Delivery, json_line
from oarlock.rowing.simulation.emulated import PERIOD_S, RATE_HZ, STREAMS, endless_sculling
from oarlock.simulation import SessionErrors, simulate_session

BEFORE_S, AFTER_S = 1.2, 1.0
"""Rest before and after a movement; a person who was asked begins after as much."""
ERRORS = SessionErrors(
    gyro_bias_rad_s=0.0, accel_bias_m_s2=0.0, accel_scale=0.0, hard_iron_ut=0.0, soft_iron=0.0
)

Rows = Mapping[str, Mapping[str, Any]]
"""Stream -> quantity -> rows at one rate."""


@dataclass
class GuidedSculler:
    """Holds the posture of the step that is asked for, does it when it runs, and rows when all is calibrated.

    Args:
        model: a sculler with its nominal mounts.
        plan: the steps; None for the model's own.
        errors: of mounts and postures. Readings have noise only: biases are not simulated in the rowing.
        seed: of all that is drawn.
        rate_hz: of all units.
    """

    model: Model
    plan: SessionPlan | None = None
    errors: SessionErrors = ERRORS
    seed: int = 0
    rate_hz: float = RATE_HZ
    truth: Calibration = field(init=False)
    """The mounts as they are."""
    _steps: dict[str, Rows] = field(init=False, default_factory=dict)
    _rowing: Rows = field(init=False)
    _names: list[str] = field(init=False)

    def __post_init__(self) -> None:
        plan = default_plan(self.model) if self.plan is None else self.plan
        trial = simulate_session(self.model, plan, self.errors, seed=self.seed, rate_hz=self.rate_hz)
        self.truth = trial.calibration
        begin_s = min(span[0] for span in trial.spans.values()) - 2.0 * BEFORE_S
        for step in plan.steps:
            from_s, to_s = trial.spans.get(step.name, (0.0, begin_s))
            if step.kind == "move":
                from_s, to_s = from_s - BEFORE_S, to_s + AFTER_S
            piece = trial.recording.slice(start_s=from_s, end_s=to_s)
            self._steps[step.name] = _rows(piece)
        self._rowing = _rows(endless_sculling(self.model, self.seed, self.rate_hz, self.truth))
        self._names = [step.name for step in plan.steps]

    def values(self, asked: Mapping[str, Any], now_s: float) -> Iterator[tuple[str, dict[str, Any]]]:
        """Stream and readings of this moment.

        Args:
            asked: the state of the guided start, as the page has it.
            now_s: the session's time.
        """
        if asked["phase"] in ("calibrated", "closed"):
            row = round(self.rate_hz * (now_s % PERIOD_S))
            yield from _at(self._rowing, row, self._rowing)
            return
        piece = self._steps[self._names[asked["at"]]]
        yield from _at(piece, self._row(asked, now_s), self._rowing)

    def _row(self, asked: Mapping[str, Any], now_s: float) -> int:
        if asked["phase"] == "running" and now_s >= asked["begins_s"]:
            return round(self.rate_hz * (now_s - float(asked["begins_s"])))
        # To and fro over the rest before the step: a person breathes.
        length = round(self.rate_hz * 0.8 * BEFORE_S)
        return abs(round(self.rate_hz * now_s) % (2 * length) - length)


def _rows(recording: Recording) -> Rows:
    return {stream.name: stream.values for stream in recording.streams}


def _at(rows: Rows, row: int, otherwise: Rows) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each stream's values in a row; of one that the movement lacks, those in which rowing begins."""
    for name in STREAMS:
        found = rows.get(name)
        values, at = (otherwise[name], 0) if found is None else (found, row)
        yield name, {q: _plain(v[min(at, len(v) - 1)]) for q, v in values.items()}


def _plain(value: Any) -> float | tuple[float, ...]:
    return float(value) if np.ndim(value) == 0 else tuple(float(x) for x in value)


async def send_guided(
    sculler: GuidedSculler, port: int, asked: Callable[[], tuple[Mapping[str, Any], float]]
) -> None:
    """Sends the sculler's readings as JSON lines to a port of this machine, until it is cancelled.

    Args:
        sculler: who is measured.
        port: of the session's source.
        asked: gives the state of the guided start, and the session's time.
    """
    begun_s, zero_s = time.monotonic(), asked()[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for count in itertools.count():
            # A busy machine sends late; units measure in time all the same.
            clock_s = count / sculler.rate_hz
            await asyncio.sleep(max(0.0, begun_s + clock_s - time.monotonic()))
            for name, values in sculler.values(asked()[0], zero_s + clock_s):
                sender.sendto(json_line(Delivery(clock_s, name, clock_s, count, values)), ("127.0.0.1", port))
