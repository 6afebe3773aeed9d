"""`looked`: whether two units sit in each other's place, from a window of readings; it runs in another process."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from oarlock.live.lately import StreamRows
from oarlock.live.swaps.fits import STEPS, Fitting
from oarlock.live.swaps.window import TIMES_S, WindowLayout
from oarlock.recording.corrections import corrected
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration

FITS = 0.35
"""Cost of a reading up to which a window fits as it is, and no exchange is tried."""
MOST_PAIRS = 10
"""Of more pairs, those are tried that look best with fewer readings after a few steps."""
ROUGH, ROUGH_STEPS = slice(None, None, 2), 3
TOGETHER = 24
"""So many suppositions are computed at once, so that they take little memory."""


@dataclass(frozen=True)
class SwapTest:
    """What is to be looked at.

    Args:
        rows: readings of each stream.
        middle_s: of the window.
        posture: that the tracker estimated last, by coordinate; NaN for what it does not know.
        calibration: with which is tracked.
    """

    rows: tuple[StreamRows, ...]
    middle_s: float
    posture: tuple[float, ...]
    calibration: Calibration | None


@dataclass(frozen=True)
class Seen:
    """What a window shows.

    Args:
        middle_s: of the window.
        cost: squared residuals of a reading as it is.
        exchanged: the pair of units whose exchange explains the readings best; empty if the window fits as it is.
        after: cost with this pair exchanged.
        next_best: cost with the second best pair exchanged.
    """

    middle_s: float
    cost: float
    exchanged: tuple[str, ...] = ()
    after: float = float("nan")
    next_best: float = float("nan")


def prepared() -> None:
    """Readies a process: behind all others, so that it never delays the tracker."""
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, 0, 15)


def looked(look: SwapTest, model: Model) -> Seen:
    """What a window shows."""
    body = model
    if look.calibration is not None and look.calibration.parameters:
        body = model.with_parameters(look.calibration.parameters)
    measured = corrected(Recording([rows.stream() for rows in look.rows]), look.calibration)
    layout = WindowLayout.of(body, look.calibration)
    seen = layout.seen(measured, look.middle_s)
    units = [s.name for s in measured.streams if isinstance(s, ImuStream) and s.name in layout.columns]
    return Search(body, layout, seen, units, np.array(look.posture), look.middle_s).seen_as()


@dataclass
class Search:
    """Fits a window as it is, then with pairs of units exchanged.

    Args:
        model: of the body.
        layout: of the window.
        seen: (times, rows) its readings.
        units: that may be exchanged.
        posture: where the search begins; NaN where nothing is known.
        middle_s: of the window.
    """

    model: Model
    layout: WindowLayout
    seen: Floats
    units: list[str]
    posture: Floats
    middle_s: float

    def __post_init__(self) -> None:
        self._fitting = Fitting(self.model, TIMES_S, self.layout.rows, self.layout.stds)
        rest = self._fitting.moves.rest
        self._tracked = np.where(np.isfinite(self.posture), self.posture, rest)
        measured = sorted(column for own in self.layout.columns.values() for column in own)
        self._count = max(int(np.isfinite(self.seen[:, measured]).sum()), 1)

    def seen_as(self) -> Seen:
        """What the window shows."""
        as_it_is = float(self._fitting.fitted(self.seen[None], self._tracked[None])[0][0]) / self._count
        if as_it_is < FITS or len(self.units) < 2:
            return Seen(self.middle_s, as_it_is)
        pairs = self._promising(list(combinations(self.units, 2)))
        costs = self._costs(np.concatenate([self.seen[None], self.layout.exchanged(self.seen, pairs)]))
        order = np.argsort(costs[1:])
        if costs[1 + order[0]] >= costs[0]:
            return Seen(self.middle_s, float(costs[0]))
        after, next_best = (float(costs[1 + order[k]]) if len(order) > k else np.inf for k in (0, 1))
        return Seen(self.middle_s, float(costs[0]), pairs[order[0]], after, next_best)

    def _promising(self, pairs: list[tuple[str, str]]) -> list[tuple[str, str]]:
        """The pairs that explain fewer readings best after a few steps, if there are many."""
        if len(pairs) <= MOST_PAIRS:
            return pairs
        rough = Fitting(self.model, TIMES_S[ROUGH], self.layout.rows, self.layout.stds)
        every = self.layout.exchanged(self.seen, pairs)[:, ROUGH]
        costs = _all_fitted(rough, every, self._tracked, ROUGH_STEPS)[0]
        return [pairs[k] for k in np.argsort(costs)[:MOST_PAIRS]]

    def _costs(self, every: Floats) -> Floats:
        """Cost of a reading for each supposition; the first is that nothing was exchanged."""
        starts = [self._tracked, self._fitting.moves.rest, self._fitting.scattered(0)]
        costs, postures = np.full(len(every), np.inf), np.zeros((len(every), len(self._tracked)))
        for _ in range(len(starts) + 1):
            # At last all begin where the best ended, so that only the supposition differs.
            start = starts.pop(0) if starts else postures[int(np.argmin(costs))]
            tried, found = _all_fitted(self._fitting, every, start)
            better = tried < costs
            costs, postures = np.where(better, tried, costs), np.where(better[:, None], found, postures)
            if costs.argmin() == 0:
                break
        return costs / self._count


def _all_fitted(fitting: Fitting, every: Floats, start: Floats, steps: int = STEPS) -> tuple[Floats, Floats]:
    parts = [every[k : k + TOGETHER] for k in range(0, len(every), TOGETHER)]
    found = [fitting.fitted(part, np.repeat(start[None], len(part), axis=0), steps) for part in parts]
    return np.concatenate([cost for cost, _ in found]), np.concatenate([posture for _, posture in found])
