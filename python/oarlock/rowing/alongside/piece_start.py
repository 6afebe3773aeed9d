"""`PieceStart`: the first strokes of a piece, until the boat or the flywheel is up to speed. For `SpeedProfile`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Floats, Indices

UP_TO_SPEED = 0.9
"""Share of the speed that follows from which a piece is up to speed: it needs three quarters of the power (0.9^3)."""
ACCELERATING = 0.8
"""A piece that begins below has a start: half of the power would hold this speed (0.8^3), the rest accelerates."""
STANDING = 0.5
"""Below, the boat drifted or lay still before: a standing start. Above, it was moving: a rolling start."""
AHEAD_S = 30.0
"""The speed that follows is the median of this time: ten strokes at 20 a minute."""
LONGEST_S = 30.0
"""A piece that takes longer to get up to speed is rowed faster and faster, as a warm-up is: it has no start."""
_FEWEST = 6
"""Rows from which there is a speed that follows, and that remain of a piece after its start."""
_MISREAD = 2.0
"""Receivers give such multiples of the speed that follows in the first row of some files."""


@dataclass(frozen=True)
class PieceStart:
    """The start of a piece.

    Attributes:
        rows: its rows, in their order.
        end_s, end_m: where it ends, on the clock and the distance of the course.
        standing: whether it began with less than half of the speed that followed.
    """

    rows: Indices
    end_s: float
    end_m: float
    standing: bool

    @property
    def name(self) -> str:
        """What it is, for people."""
        return "standing start" if self.standing else "rolling start"


def start_of(
    order: Indices, time_s: Floats, distance_m: Floats, speed: Floats, begin: tuple[float, float]
) -> PieceStart | None:
    """The start of a piece; None if it begins at speed, or takes longer than `LONGEST_S`.

    Args:
        order: the rows of the piece.
        time_s: of all rows.
        distance_m: of all rows.
        speed: of all rows, in any unit; NaN where it is unknown.
        begin: time and distance at which the piece begins.
    """
    early = order[:-_FEWEST][time_s[order[:-_FEWEST]] <= begin[0] + LONGEST_S + AHEAD_S]
    share = np.array([_share(order[k:], time_s, speed) for k in range(len(early))])
    known = np.flatnonzero(np.isfinite(share) & (share <= _MISREAD))
    # The first row of a device may have the speed of before the pause.
    slow = [k for k in known[:2] if share[k] < ACCELERATING]
    fast = [k for k in known if slow and k > slow[0] and share[k] >= UP_TO_SPEED]
    if not fast:
        return None
    rows = order[: fast[0]]
    end_s, end_m = float(time_s[rows[-1]]), float(distance_m[rows[-1]])
    if not 0.0 < end_s - begin[0] <= LONGEST_S or _went_on(order[fast[0] :], time_s, distance_m, begin, rows):
        return None
    return PieceStart(rows, end_s, end_m, bool(np.nanmin(share[slow[0] : fast[0]]) < STANDING))


def _share(order: Indices, time_s: Floats, speed: Floats) -> float:
    """The speed of the first of these rows as a share of the speed that follows; NaN if one is unknown."""
    later = order[1:][time_s[order[1:]] <= time_s[order[0]] + AHEAD_S]
    known = speed[later]
    known = known[np.isfinite(known) & (known > 0.0)]
    return float(speed[order[0]] / np.median(known)) if len(known) >= _FEWEST else float("nan")


def _went_on(
    later: Indices, time_s: Floats, distance_m: Floats, begin: tuple[float, float], rows: Indices
) -> bool:
    """Whether the distance says that the boat was up to speed: then the device's speed lags or is wrong."""
    after = later[time_s[later] <= time_s[rows[-1]] + AHEAD_S]
    went_m_s = (distance_m[rows[-1]] - begin[1]) / (time_s[rows[-1]] - begin[0])
    then_m_s = (distance_m[after[-1]] - distance_m[rows[-1]]) / (time_s[after[-1]] - time_s[rows[-1]])
    return bool(went_m_s >= UP_TO_SPEED * then_m_s)
