"""`fill_gaps`: finds gaps in marker trajectories, fills short ones by smoothing splines, and reports all."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from oarlock.evaluation.markers.smoothing_spline import smoothed_at
from oarlock.evaluation.markers.trajectories import Bools, Markers
from oarlock.storage.array_gate import FloatArray
from oarlock.storage.errors import DataError

WINDOW_S: Final = 0.2
"""Of a gap's neighbours on either side that shape its filling: shorter ones know no slope, longer ones add nothing."""
_FEWEST: Final = 3
"""Frames seen on either side: a spline's slope needs two, and its noise is judged by more."""
_LEAST_STD_M: Final = 1e-9
"""Of a position that was put in: above 0, so that it can be told from one that was seen."""
_MOST: Final = 64
"""Frames on either side: more only cost time."""


@dataclass(frozen=True)
class Gap:
    """A stretch in which a marker was not seen.

    Args:
        marker: its name.
        start_s: stamp of the first missing frame, s.
        end_s: stamp of the last missing frame, s.
        duration_s: from the first missing frame to the first that is there again, s.
        frames: how many are missing.
        filled: whether positions were put in.
        reason: why not; empty if filled.
    """

    marker: str
    start_s: float
    end_s: float
    duration_s: float
    frames: int
    filled: bool
    reason: str = ""

    @property
    def row(self) -> dict[str, Any]:
        """The gap as plain values, for tables and JSON."""
        return dict(vars(self))


@dataclass(frozen=True)
class FilledMarkers:
    """What `fill_gaps` gives.

    Args:
        markers: short gaps filled, long ones still NaN.
        gaps: every gap that was found, by marker and time.
        std_m: (T, n) standard deviation of each coordinate that was put in, largest in the middle of a gap; 0 where
            the marker was seen, and where it is still missing.
    """

    markers: Markers
    gaps: tuple[Gap, ...]
    std_m: FloatArray

    @property
    def estimated(self) -> Bools:
        """Where a position was put in, (T, n): no measurement stands behind it."""
        return np.asarray(self.std_m > 0.0)

    @property
    def refused(self) -> tuple[Gap, ...]:
        """The gaps that were left."""
        return tuple(gap for gap in self.gaps if not gap.filled)


def fill_gaps(markers: Markers, longest_s: float = 0.2) -> FilledMarkers:
    """Fill gaps up to a length by splines through the neighbours; leave longer ones, and say which is which.

    Each gap gets a quintic smoothing spline over what was seen within 0.2 s of it, its smoothness chosen by likelihood
    (`smoothing_spline`). An interpolating spline would take the noise of the last frames for a slope:
    with 1 mm of noise at 100 Hz it misses a gap of 200 ms in the path of a quick hand by 6 mm (cubic) or 40 mm
    (quintic), the smoothing spline by 1.3 mm; without noise that is 0.1 mm.

    Args:
        markers: with NaN where not seen.
        longest_s: longest gap that is filled, s, counted from the first missing frame to the next one seen.

    Returns:
        The filled trajectories and all gaps. Refused, and left NaN, are longer gaps, gaps at the start or the end,
        and gaps with fewer than three frames seen beside them on one side.

    Raises:
        DataError: `longest_s` is negative or no number.
    """
    if not (longest_s >= 0.0 and np.isfinite(longest_s)):
        raise DataError(f"fill_gaps: longest_s = {longest_s}; expected seconds, 0 or more")
    position, std = np.array(markers.position_m), np.zeros(markers.seen.shape)
    gaps: list[Gap] = []
    for k, name in enumerate(markers.names):
        for first, last in stretches(~markers.seen[:, k]):
            reason, near = _neighbours(markers, k, (first, last), longest_s)
            if near is not None:
                place, spread = smoothed_at(
                    markers.time_s[near], markers.position_m[near, k], markers.time_s[first:last]
                )
                position[first:last, k] = place
                std[first:last, k] = np.maximum(spread, _LEAST_STD_M)
            gaps.append(Gap(name, *_span(markers.time_s, first, last), near is not None, reason))
    return FilledMarkers(Markers(markers.names, markers.time_s, position), tuple(gaps), std)


def stretches(true: Bools) -> Iterator[tuple[int, int]]:
    """Runs of True, as first index and the one behind the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        yield int(first), int(last)


def _span(time_s: FloatArray, first: int, last: int) -> tuple[float, float, float, int]:
    # behind the last frame there is none; it lasts as long as the one before it
    again = time_s[last] if last < len(time_s) else 2.0 * time_s[-1] - time_s[max(len(time_s) - 2, 0)]
    return float(time_s[first]), float(time_s[last - 1]), float(again - time_s[first]), last - first


def _neighbours(markers: Markers, k: int, gap: tuple[int, int], longest_s: float) -> tuple[str, Any]:
    """Why a gap is not filled, or the frames seen on both sides that it is filled from."""
    first, last = gap
    time_s, seen = markers.time_s, markers.seen[:, k]
    if not seen.any():
        return "never seen", None
    if first == 0 or last == len(time_s):
        return "at the start" if first == 0 else "at the end", None
    length = float(time_s[last] - time_s[first])
    # stamps may be rounded: half a frame is no reason to refuse
    if length > longest_s + 0.5 / markers.rate_hz:
        return f"longer than {longest_s:g} s", None
    before, behind = _side(time_s, seen, gap, -1), _side(time_s, seen, gap, 1)
    if min(len(before), len(behind)) < _FEWEST:
        side = "before" if len(before) < _FEWEST else "behind"
        return f"only {min(len(before), len(behind))} frames seen {side} it", None
    return "", np.concatenate([before, behind])


def _side(time_s: FloatArray, seen: Bools, gap: tuple[int, int], side: int) -> Any:
    """Frames seen before (-1) or behind (1) a gap, in order of time."""
    if side < 0:
        seen_there, edge = np.flatnonzero(seen[: gap[0]])[::-1], time_s[gap[0] - 1]
    else:
        seen_there, edge = np.flatnonzero(seen[gap[1] :]) + gap[1], time_s[gap[1]]
    far = np.abs(time_s[seen_there] - edge)
    close = seen_there[(far <= WINDOW_S) | ((np.arange(len(far)) < 5) & (far <= 2.0 * WINDOW_S))][:_MOST]
    return np.sort(close)


def gaps_text(gaps: Sequence[Gap]) -> str:
    """A table of gaps: marker, from, to, length, frames, filled or why not."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["marker", "start_s", "end_s", "duration_s", "frames", "filled", "reason"])
    for gap in gaps:
        times = (f"{value:.6f}" for value in (gap.start_s, gap.end_s, gap.duration_s))
        writer.writerow([gap.marker, *times, gap.frames, "yes" if gap.filled else "no", gap.reason])
    return stream.getvalue()
