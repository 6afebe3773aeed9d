"""Estimates the delays of streams from a filter's innovations, window by window, for the fine clock search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from oarlock._core import Config, Model, score_many
from oarlock.calibration.clocks.devices import is_one_logger
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

Span = tuple[float, float]
Groups = Sequence[tuple[str, ...]]

PIECE_S = 40.0
SETTLE_S = 4.0
"""The fit of a start may be poor, and what is to be seen builds up."""
WINDOW_S = 5.0
"""A few strides: long enough to tell a mount from a delay, short enough for many windows."""
LEAST_S = 8.0
ESTIMATE = ("gyro_bias", "accel_bias", "surge")
_OPEN_S = 0.05
"""Standard deviation of a delay before a window is looked at: what no row tells stays where it is."""
_SHARE = 0.1
"""Of what innovations seem to tell: where a body is no tree they last for about so many samples."""
_MERGE_S = 1e-5
"""Samples of clocks that are off by half a millisecond must not become one."""


@dataclass(frozen=True)
class DelayEstimate:
    """Estimated delays of some clocks in one window.

    Args:
        time_s: middle of the window.
        delay_s: (clocks,) time stamp minus true time, s.
        std_s: (clocks,) standard deviations, s.
    """

    time_s: float
    delay_s: Floats
    std_s: Floats


def spans(recording: Recording, most: int) -> list[Span]:
    """Pieces evenly over the time that all streams share.

    Raises:
        DataError: less than `LEAST_S` is shared.
    """
    start = max(float(s.time_s[0]) for s in recording)
    end = min(float(s.time_s[-1]) for s in recording)
    if end - start < LEAST_S:
        raise DataError(
            f"calibrate_clocks: the streams share {max(0.0, end - start):.1f} s (from {start:.2f} to {end:.2f} s); "
            f"at least {LEAST_S:g} s of movement are needed. Leave out a stream that is too short with "
            "recording.only(...)"
        )
    count = max(1, min(most, round((end - start) / PIECE_S)))
    length = min(PIECE_S, (end - start) / count)
    starts = np.linspace(start, end - length, count)
    return [(float(first), float(first + length)) for first in starts]


@dataclass(frozen=True)
class Filtering:
    """Settings of the filter that estimates delays.

    Args:
        model: the body and its sensors.
        known: the calibration that the filter uses.
        groups: streams that share one clock.
        anchored: true if another stream has the reference clock. Otherwise only differences between clocks can be
            estimated, and their mean is zero.
        threads: number of parts processed at a time; None uses all cores.
    """

    model: Model
    known: Calibration
    groups: Groups
    anchored: bool
    threads: int | None

    def sights(self, recording: Recording, pieces: Sequence[Span]) -> list[DelayEstimate]:
        """What each window of each piece says; a piece in which the track was lost says nothing.

        The filter takes clocks as right. How its innovations answer to a delay of each stream, to mounts, lengths,
        places and zeros goes along with it (Friedland 1969), and each window's normal equations are solved for all of
        these together.
        """
        sampling: dict[str, Any] = {}
        if is_one_logger(recording):
            # Its encoders are read together, so they are inputs at their instants; clocks of units are a little off.
            sampling = {
                "sample_rate_hz": 0.0,
                "inputs": [joint.name for joint in self.model.describe().inputs],
            }
        config = Config(
            structure="tree", filter="ekf", estimate=_estimate(recording), merge_s=_MERGE_S, **sampling
        )
        jobs = [(recording.slice(*piece), self.known, config) for piece in pieces]
        settle = min(SETTLE_S, 0.25 * (pieces[0][1] - pieces[0][0]))
        found = []
        for result in score_many(self.model, jobs, settle, WINDOW_S, self.threads, None):
            if isinstance(result, DataError):
                raise result
            if isinstance(result, Exception):
                continue
            parameters, windows = result
            for start, end, _rows, normal, right in windows:
                if end - start > 0.5 * WINDOW_S:
                    middle = 0.5 * (start + end)
                    found.append(_solved(middle, parameters, normal, right, self.groups, self.anchored))
        return found


def _estimate(recording: Recording) -> tuple[str, ...]:
    """States to estimate. With magnetometers they include mounts, which reduces the effect of misaligned units."""
    units = [s for s in recording if isinstance(s, ImuStream)]
    return (*ESTIMATE, "mounts") if all(u.mag_ut is not None for u in units) else ESTIMATE


def _solved(
    time_s: float,
    parameters: Sequence[tuple[str, float]],
    normal: Floats,
    right: Floats,
    clocks: Groups,
    anchored: bool,
) -> DelayEstimate:
    """Clocks from one window's normal equations; everything else is as uncertain as the model says."""
    names = [name for name, _ in parameters]
    others = [k for k, name in enumerate(names) if not name.endswith(".delay")]
    turn = np.zeros((len(right), len(others) + len(clocks)))
    turn[others, np.arange(len(others))] = 1.0
    for k, streams in enumerate(clocks):
        for name in (f"{stream}.delay" for stream in streams if f"{stream}.delay" in names):
            row = names.index(name)
            turn[row, len(others) + k] = 1.0 / parameters[row][1]
    prior = np.diag(np.r_[np.ones(len(others)), np.full(len(clocks), _OPEN_S**-2)])
    # What rounding and gates leave below nought is none.
    information, axes = np.linalg.eigh(_SHARE * turn.T @ normal @ turn)
    spread = np.linalg.inv((axes * np.maximum(information, 0.0)) @ axes.T + prior)
    delay = (spread @ (_SHARE * turn.T @ right))[len(others) :]
    spread = spread[len(others) :, len(others) :]
    if not anchored:
        centred = np.eye(len(clocks)) - 1.0 / len(clocks)
        delay, spread = centred @ delay, centred @ spread @ centred
    return DelayEstimate(time_s, np.asarray(delay), np.sqrt(np.diag(spread)))


def bare(known: Calibration) -> Calibration:
    """The calibration for the filter: values alone; their uncertainty is that of the model."""
    return Calibration(known.parameters, known.mounts, mag_offsets_ut=known.mag_offsets_ut)
