"""`LiveTechnique`: the technique of each stroke as soon as the next one begins, from a tracker's estimates."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from oarlock import Belief, Calibration, Model
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.strokes.live_strokes import LiveStrokes
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.tracking import track_of_beliefs

KEPT_S = 14.0
"""Estimates that are kept: two strokes at 10 a minute."""
WHOLE_EVERY_S = 0.5
"""Correlations change slowly: one estimate in so long is kept with its covariance."""
MARGIN_S = 0.7
"""Around a stroke, so that its catches are found by what comes before and behind them."""
SAME_S = 0.3
_SIGNALS = (("oars", ("r_oar_phi", "l_oar_phi", "oar_phi")), ("handle", ("handle",)), ("seat", ("seat",)))


@dataclass(frozen=True)
class StrokeEstimates:
    """Estimates around a stroke that has ended; with them alone `live_stroke` computes its technique.

    Attributes:
        catch_s: the stroke's catch.
        time_s: (T,) s.
        means, stds: (T, n) of the states.
        beliefs: one each second, with its time.
    """

    catch_s: float
    time_s: Floats
    means: Floats
    stds: Floats
    beliefs: tuple[tuple[float, Belief], ...]


@dataclass
class LiveTechnique:
    """Finds the strokes in a tracker's estimates as they come.

    Args:
        model: of the rower; its encoders are sensors of the tracker (`Config.inputs` without them).

    Raises:
        DataError: the model has no joint that tells strokes.
    """

    model: Model
    _kept: deque[tuple[float, Floats, Floats]] = field(default_factory=deque)
    _whole: deque[tuple[float, Belief]] = field(default_factory=deque)
    _catch_s: float = math.nan

    def __post_init__(self) -> None:
        names = self.model.coordinate_names
        found = [(source, [n for n in joints if n in names]) for source, joints in _SIGNALS]
        source, joints = next((one for one in found if one[1]), ("", []))
        if not source:
            raise DataError(
                f"strokes: the model {self.model.name} has none of the joints oar_phi, r_oar_phi, l_oar_phi, "
                "handle and seat"
            )
        self._finder, self._columns = LiveStrokes(source), {n: names.index(n) for n in joints}

    def step(self, time_s: float, belief: Belief) -> StrokeEstimates | None:
        """The estimates of a stroke, once its end is sure; that is within 0.3 s of the next catch, and its margin.

        Args:
            time_s: of the estimate; not before the last one.
            belief: of the tracker.
        """
        self._kept.append((time_s, belief.mean, belief.std))
        if not self._whole or time_s - self._whole[-1][0] > WHOLE_EVERY_S:
            self._whole.append((time_s, belief))
        for kept in (self._kept, self._whole):
            while time_s - kept[0][0] > KEPT_S:
                kept.popleft()
        values = {name: float(belief.mean[column]) for name, column in self._columns.items()}
        for event in self._finder.step(time_s, values):
            if event.kind == "catch":
                last_s, self._catch_s = self._catch_s, event.time_s
                # An event that replaces one is the same catch, seen better.
                if event.time_s - last_s > SAME_S:
                    return self._stretch(last_s)
        return None

    def _stretch(self, catch_s: float) -> StrokeEstimates | None:
        rows = [row for row in self._kept if row[0] > catch_s - MARGIN_S]
        if not rows or rows[0][0] > catch_s:
            return None
        whole = tuple(row for row in self._whole if row[0] >= rows[0][0])
        time_s, means, stds = (np.array([row[k] for row in rows]) for k in range(3))
        return StrokeEstimates(catch_s, time_s, means, stds, whole) if whole else None


@dataclass(frozen=True)
class LiveStroke:
    """A finished stroke.

    Attributes:
        time_s: of its catch.
        values: column of `technique` -> value and standard deviation, SI units; what is not known is left out.
    """

    time_s: float
    values: Mapping[str, tuple[float, float]]


def live_stroke(
    stretch: StrokeEstimates, model: Model, calibration: Calibration | None = None
) -> LiveStroke | None:
    """The technique of the stroke in a stretch, as `technique` gives it; None if it finds none there.

    It takes longer than a tracker may wait: give it to another process.
    """
    try:
        found = technique(
            track_of_beliefs(model, stretch.time_s, stretch.means, stretch.stds, stretch.beliefs),
            calibration=calibration,
        )
    except DataError:
        return None
    catches = found.found.catch_time_s
    if not catches.size:
        return None
    row = int(np.argmin(np.abs(catches - stretch.catch_s)))
    if abs(catches[row] - stretch.catch_s) > SAME_S or not math.isfinite(found.found.end_time_s[row]):
        return None
    table = found.strokes
    values = {name: (float(table[name][row]), float(table.stds[name][row])) for name in table.stds}
    return LiveStroke(
        float(catches[row]), {name: pair for name, pair in values.items() if math.isfinite(pair[0] + pair[1])}
    )
