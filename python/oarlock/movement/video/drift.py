"""Refines the alignment of a long video: the offset of each half minute, and a straight line through them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from oarlock.movement.video.alignment import VideoAlignment, align
from oarlock.movement.video.signals import Signals
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.statistics import robust_std

WINDOW_S = 30.0
LEAST_WINDOWS = 6
NEAR_S = 0.6
"""Within this of the common offset each half minute is searched: less than half a cycle, so that none slips by one."""


def with_drift(picture: Signals, body: Signals, found: VideoAlignment, frame_s: float) -> VideoAlignment:
    """The alignment with the drift of the two clocks, if both cover three minutes; otherwise as it is.

    Args:
        picture: courses of the picture's motion, in video time.
        body: courses of the body's motion, in track time.
        found: their alignment without drift.
        frame_s: time from picture to picture, s.
    """
    if found.overlap_s < LEAST_WINDOWS * WINDOW_S:
        return found
    seen, moved = picture.times_s(), body.times_s() - found.offset_s
    first, last = max(float(seen[0]), float(moved[0])), min(float(seen[-1]), float(moved[-1]))
    count = int((last - first) / WINDOW_S)
    edges = np.linspace(first, last, count + 1)
    middles, offsets, variances = [], [], []
    for start, end in pairwise(edges):
        try:
            part = align(
                picture.part(float(start), float(end)),
                body,
                near_s=found.offset_s,
                within_s=NEAR_S,
                frame_s=frame_s,
            )
        except DataError:  # half a minute at rest or without picture says nothing
            continue
        middles.append(0.5 * (start + end))
        offsets.append(part.offset_s)
        # the time within a picture is common to all windows
        variances.append(max(part.std_s**2 - frame_s**2 / 12.0, 0.0))
    if len(middles) < LEAST_WINDOWS:
        return found
    slope, std, offset_s = _line(np.array(middles), np.array(offsets), float(np.mean(variances)))
    if abs(slope) <= 3.0 * std or abs(slope) * (last - first) < 0.25 * frame_s:
        return replace(found, drift_std_ppm=1e6 * std)
    return replace(found, offset_s=offset_s, drift_ppm=1e6 * slope, drift_std_ppm=1e6 * std)


def _line(middles: Floats, offsets: Floats, variance: float) -> tuple[float, float, float]:
    """Slope, its standard deviation from fits and scatter, and the offset at video time 0 (Theil 1950, Sen 1968).

    The slope is the median of all pairs', so that a window that went wrong does no harm.
    """
    i, j = np.triu_indices(len(middles), 1)
    slope = float(np.median((offsets[j] - offsets[i]) / (middles[j] - middles[i])))
    rest = offsets - slope * middles
    offset_s = float(np.median(rest))
    scatter = float(np.hypot(robust_std(rest - offset_s), np.sqrt(variance)))
    return slope, scatter / float(np.sqrt(np.sum((middles - middles.mean()) ** 2))), offset_s
