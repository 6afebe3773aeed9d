"""`looked`: whether two units sit in each other's place, from a window of readings; it runs in another process."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from oarlock.live.lately import Rows
from oarlock.live.swaps.fits import Fitting
from oarlock.live.swaps.window import TIMES, WINDOW_S, Layout
from oarlock.recording.corrections import corrected
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import FloatArray

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration

FITS = 0.35
"""Cost of a reading up to which a window fits as it is, and no exchange is tried."""
SCATTERED = 1
"""So many postures between the limits are tried beside that of the tracker and the model's rest."""
TOGETHER = 24
"""So many suppositions are computed at once, so that they take little memory."""


@dataclass(frozen=True)
class Look:
    """What is to be looked at.

    Args:
        rows: readings of each stream.
        middle_s: of the window.
        posture: that the tracker estimated last, by coordinate; NaN for what it does not know.
        calibration: with which is tracked.
    """

    rows: tuple[Rows, ...]
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


def prepared(threads: int = 1) -> None:
    """Readies a process: behind all others, so that it never delays the tracker."""
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, 0, 15)


def looked(look: Look, model: Model) -> Seen:
    """What a window shows."""
    body = model
    if look.calibration is not None and look.calibration.lengths:
        body = model.with_parameters(look.calibration.lengths)
    measured = corrected(Recording([rows.stream() for rows in look.rows]), look.calibration)
    layout = Layout.of(body, look.calibration)
    times = WINDOW_S * ((np.arange(TIMES) + 0.5) / TIMES - 0.5)
    fitting = Fitting(body, times, layout.rows, layout.stds)
    return searched(
        fitting,
        layout,
        layout.seen(measured, look.middle_s),
        look.posture,
        look.middle_s,
        _units(measured, layout),
    )


def _units(measured: Recording, layout: Layout) -> list[str]:
    return [s.name for s in measured.streams if isinstance(s, ImuStream) and s.name in layout.columns]


def searched(
    fitting: Fitting,
    layout: Layout,
    seen: FloatArray,
    posture: tuple[float, ...],
    middle_s: float,
    units: list[str],
) -> Seen:
    """Fits the window as it is, then with each pair of units exchanged."""
    known = np.array(posture)
    tracked = np.where(np.isfinite(known), known, fitting.moves.rest)
    count = int(np.isfinite(seen[:, sorted(c for own in layout.columns.values() for c in own)]).sum())
    first = fitting.fitted(seen[None], tracked[None])[0][0] / count
    if first < FITS or len(units) < 2:
        return Seen(middle_s, float(first))
    pairs = list(combinations(units, 2))
    every = np.concatenate([seen[None], layout.exchanged(seen, pairs)])
    starts = [tracked, fitting.moves.rest, *(fitting.scattered(k) for k in range(SCATTERED))]
    costs, postures = np.full(len(every), np.inf), np.zeros((len(every), len(tracked)))
    for _ in range(len(starts) + 1):
        start = starts.pop(0) if starts else postures[int(np.argmin(costs))]
        tried, found = _all_fitted(fitting, every, start)
        better = tried < costs
        costs, postures = np.where(better, tried, costs), np.where(better[:, None], found, postures)
    costs /= count
    order = np.argsort(costs[1:])
    after, next_best = (float(costs[1:][order[k]]) if len(order) > k else np.inf for k in (0, 1))
    return Seen(middle_s, float(costs[0]), pairs[order[0]], after, next_best)


def _all_fitted(fitting: Fitting, every: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    parts = [every[k : k + TOGETHER] for k in range(0, len(every), TOGETHER)]
    found = [fitting.fitted(part, np.repeat(start[None], len(part), axis=0)) for part in parts]
    return np.concatenate([cost for cost, _ in found]), np.concatenate([posture for _, posture in found])
