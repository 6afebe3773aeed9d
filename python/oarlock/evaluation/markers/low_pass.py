"""`low_pass`: zero-phase low-pass filter for marker trajectories."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, overload

import numpy as np

from oarlock.evaluation.markers.gaps import FilledMarkers, stretches
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.recording.butterworth import passed_twice
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_FEWEST_FRAMES_A_PERIOD: Final = 2.5
_MOST_JITTER: Final = 0.25
"""Largest relative deviation of a time step: time stamps rounded to milliseconds stay below, a lost frame does not."""


@overload
def low_pass(markers: Markers, cutoff_hz: float = ..., order: int = ...) -> Markers: ...


@overload
def low_pass(markers: FilledMarkers, cutoff_hz: float = ..., order: int = ...) -> FilledMarkers: ...


def low_pass(
    markers: Markers | FilledMarkers, cutoff_hz: float = 10.0, order: int = 4
) -> Markers | FilledMarkers:
    """Butterworth low-pass, forward and backward: no delay.

    Each stretch between gaps is filtered separately; a marker that is visible in a single frame stays unchanged. The
    ends of a stretch are extended by odd reflection over one period of the cut-off, or over the length of the stretch.

    Args:
        markers: evenly sampled; NaN where not visible. Fill short gaps first: a result of `fill_gaps` is accepted and
            is returned with filtered markers.
        cutoff_hz: frequency at which the amplitude falls to 1/sqrt(2) after both passes, Hz.
        order: order of both passes together, even. Each pass has half of it. The cut-off of one pass is higher than
            `cutoff_hz` by the factor (sqrt(2) - 1)^(-1 / order), 1.25 at order 4, so that both together have
            `cutoff_hz`.

    Source: D. A. Winter 2009, "Biomechanics and Motor Control of Human Movement", section 3.4.4.2 (factor of two
    passes); bilinear transform with the frequencies warped.

    Raises:
        DataError: fewer than 2.5 frames per period of the cut-off, uneven time stamps, or an odd order.
    """
    if isinstance(markers, FilledMarkers):
        return replace(markers, markers=low_pass(markers.markers, cutoff_hz, order))
    rate_hz = markers.rate_hz
    if not (cutoff_hz > 0.0 and np.isfinite(cutoff_hz)):
        raise DataError(f"low_pass: cutoff_hz = {cutoff_hz}; expected a positive number of Hz")
    if order < 2 or order % 2:
        raise DataError(f"low_pass: order = {order}; expected 2, 4, 6 ...: each pass has half of it")
    if not rate_hz >= _FEWEST_FRAMES_A_PERIOD * cutoff_hz:
        raise DataError(
            f"low_pass: {rate_hz:.4g} frames/s are too few for a cut-off of {cutoff_hz:g} Hz; it needs "
            f"{_FEWEST_FRAMES_A_PERIOD:g} per period. Lower the cut-off to "
            f"{rate_hz / _FEWEST_FRAMES_A_PERIOD:.3g} Hz or less."
        )
    _check_even(markers.time_s)
    position = np.array(markers.position_m)
    for k in range(len(markers.names)):
        for first, last in stretches(markers.seen[:, k]):
            if last - first > 1:
                position[first:last, k] = passed_twice(position[first:last, k], rate_hz, cutoff_hz, order)
    return Markers(markers.names, markers.time_s, position)


def _check_even(time_s: Floats) -> None:
    steps = np.diff(time_s)
    usual = float(np.median(steps))
    off = np.flatnonzero(np.abs(steps - usual) > _MOST_JITTER * usual)
    if off.size:
        raise DataError(
            f"low_pass: frames are {steps[off[0]]:.4g} s apart at {time_s[off[0]]:.4g} s, {usual:.4g} s elsewhere "
            f"({off.size} such places); a filter needs even time stamps. Insert frames of NaN where some are missing."
        )
