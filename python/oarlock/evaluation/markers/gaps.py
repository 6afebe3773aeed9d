"""`fill_gaps`: finds gaps in marker trajectories, fills short ones by smoothing splines, and reports all."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from oarlock.evaluation.markers.smoothing_spline import smoothed_at
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

WINDOW_S: Final = 0.2
"""Length of data on either side of a gap to which the spline is fitted, s. Shorter data do not determine a slope."""
_FEWEST: Final = 3
"""Smallest number of visible frames on either side: a slope needs two, the noise level more."""
_LEAST_STD_M: Final = 1e-9
"""Smallest standard deviation of a filled position, m. It is above 0 to distinguish it from a measured one."""
_MOST: Final = 64
"""Largest number of frames on either side; more only take time."""


@dataclass(frozen=True)
class Gap:
    """A stretch in which a marker was not visible.

    Args:
        marker: its name.
        start_s: time stamp of the first missing frame, s.
        end_s: time stamp of the last missing frame, s.
        duration_s: from the first missing frame to the next visible one, s.
        frames: number of missing frames.
        filled: whether the gap was filled.
        reason: why it was not filled; empty if filled.
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
    """Result of `fill_gaps`.

    Args:
        markers: short gaps filled, long ones still NaN.
        gaps: all gaps, by marker and time.
        std_m: (T, n) standard deviation of each filled coordinate, largest in the middle of a gap; 0 where the marker
            was visible, and where it is still missing.
    """

    markers: Markers
    gaps: tuple[Gap, ...]
    std_m: Floats

    @property
    def estimated(self) -> Bools:
        """Where a position was filled and not measured, (T, n)."""
        return np.asarray(self.std_m > 0.0)

    @property
    def refused(self) -> tuple[Gap, ...]:
        """The gaps that were not filled."""
        return tuple(gap for gap in self.gaps if not gap.filled)


def fill_gaps(markers: Markers, longest_s: float = 0.2) -> FilledMarkers:
    """Fill gaps up to a given length by splines; leave longer ones, and report all gaps.

    Each gap is filled by a quintic smoothing spline through the positions within 0.2 s of it. Its smoothness follows
    from the likelihood (`smoothing_spline`). An interpolating spline would mistake the noise of the last frames for a
    slope: with 1 mm of noise at 100 Hz its error in a gap of 200 ms in the path of a fast hand is 6 mm (cubic) or 40 mm
    (quintic), that of the smoothing spline 1.3 mm, without noise 0.1 mm.

    Args:
        markers: the trajectories, NaN where not visible.
        longest_s: longest gap that is filled, s, from the first missing frame to the next visible one.

    Returns:
        The filled trajectories and all gaps. Longer gaps, gaps at the start or end, and gaps with fewer than three
        visible frames on one side stay NaN.

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
    """Runs of True: first index and the index after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        yield int(first), int(last)


def _span(time_s: Floats, first: int, last: int) -> tuple[float, float, float, int]:
    # the last frame has no successor; the previous interval is used
    again = time_s[last] if last < len(time_s) else 2.0 * time_s[-1] - time_s[max(len(time_s) - 2, 0)]
    return float(time_s[first]), float(time_s[last - 1]), float(again - time_s[first]), last - first


def _neighbours(markers: Markers, k: int, gap: tuple[int, int], longest_s: float) -> tuple[str, Any]:
    """The reason why a gap is not filled, or the visible frames on both sides from which it is filled."""
    first, last = gap
    time_s, seen = markers.time_s, markers.seen[:, k]
    if not seen.any():
        return "never seen", None
    if first == 0 or last == len(time_s):
        return "at the start" if first == 0 else "at the end", None
    length = float(time_s[last] - time_s[first])
    # time stamps may be rounded, so half a frame more is allowed
    if length > longest_s + 0.5 / markers.rate_hz:
        return f"longer than {longest_s:g} s", None
    before, behind = _side(time_s, seen, gap, -1), _side(time_s, seen, gap, 1)
    if min(len(before), len(behind)) < _FEWEST:
        side = "before" if len(before) < _FEWEST else "behind"
        return f"only {min(len(before), len(behind))} frames seen {side} it", None
    return "", np.concatenate([before, behind])


def _side(time_s: Floats, seen: Bools, gap: tuple[int, int], side: int) -> Any:
    """Visible frames before (-1) or after (1) a gap, in order of time."""
    if side < 0:
        seen_there, edge = np.flatnonzero(seen[: gap[0]])[::-1], time_s[gap[0] - 1]
    else:
        seen_there, edge = np.flatnonzero(seen[gap[1] :]) + gap[1], time_s[gap[1]]
    far = np.abs(time_s[seen_there] - edge)
    close = seen_there[(far <= WINDOW_S) | ((np.arange(len(far)) < 5) & (far <= 2.0 * WINDOW_S))][:_MOST]
    return np.sort(close)


def gaps_text(gaps: Sequence[Gap]) -> str:
    """A table of gaps: marker, start, end, duration, frames, filled or the reason."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["marker", "start_s", "end_s", "duration_s", "frames", "filled", "reason"])
    for gap in gaps:
        times = (f"{value:.6f}" for value in (gap.start_s, gap.end_s, gap.duration_s))
        writer.writerow([gap.marker, *times, gap.frames, "yes" if gap.filled else "no", gap.reason])
    return stream.getvalue()
