"""Resamples a track at equal phases of every stroke: catch to finish, finish to next catch. For technique."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from oarlock import Track
from oarlock.rowing.analysis.local_cubic import local_cubic
from oarlock.storage.arrays import Floats
from oarlock.storage.even_times import even_times_of_stretches
from oarlock.storage.statistics import robust_std

STEPS = 60
"""Of the drive, and of the recovery."""
POINTS = 2 * STEPS + 1
CATCH, FINISH, END = 0, STEPS, 2 * STEPS
DRIVE = slice(0, STEPS + 1)
RECOVERY = slice(STEPS, POINTS)
LAST_FIFTH = slice(STEPS - STEPS // 5, STEPS + 1)
"""Of the drive: the finish window."""
FIRST_FIFTH = STEPS // 5
MIDDLE = (slice(STEPS // 5, STEPS - STEPS // 5 + 1), slice(STEPS + STEPS // 5, 2 * STEPS - STEPS // 5 + 1))
"""Middle three fifths of drive and recovery."""

_SILENT_S = 0.15
_RATE_WINDOW_S = 0.14
_FEWEST = 4
_LASTING = 8.0
"""How much more than white noise what a track leaves over moves a slope: it lasts for several samples."""


@dataclass(frozen=True, eq=False)
class PhaseGrid:
    """Times (N, POINTS), s; NaN where a stroke has no recovery that ended in a catch."""

    time_s: Floats

    @staticmethod
    def of(catch_s: Floats, finish_s: Floats, end_s: Floats) -> PhaseGrid:
        """Of strokes with these events, (N,) each, s."""
        share = np.linspace(0.0, 1.0, STEPS + 1)
        drive = catch_s[:, None] + share * (finish_s - catch_s)[:, None]
        recovery = finish_s[:, None] + share[1:] * (end_s - finish_s)[:, None]
        return PhaseGrid(np.concatenate([drive, recovery], axis=1))

    def __len__(self) -> int:
        return len(self.time_s)

    @cached_property
    def phase(self) -> Floats:
        """Share of the cycle passed (N, POINTS); NaN where there is no next catch."""
        start, end = self.time_s[:, :1], self.time_s[:, END:]
        return np.asarray((self.time_s - start) / (end - start))

    def slope(self, values: Floats) -> Floats:
        """Derivative over time (N, POINTS) of what is known at the grid's points; the two halves meet at the finish."""
        found = np.full(values.shape, np.nan)
        for part in (RECOVERY, DRIVE):
            steps = self.time_s[:, part]
            step = (steps[:, -1] - steps[:, 0]) / STEPS
            found[:, part] = np.gradient(values[:, part], axis=1) / step[:, None]
        return found


@dataclass(frozen=True, eq=False)
class CoordinateCurves:
    """The track's coordinates in continuous time: values, rates and standard deviations.

    Rates are slopes of the values over 0.14 s (Savitzky and Golay 1964): a filter's own rates jump from sample to
    sample where its model is wrong, and a peak would be one of these jumps.

    Args:
        track: gives times and standard deviations.
        q: (T, n_coordinates) its coordinates; NaN where they were not observed.
    """

    track: Track
    q: Floats

    def at(self, grid: PhaseGrid) -> tuple[Floats, Floats, Floats, Floats]:
        """Values, rates and their standard deviations, (N, POINTS, n_coordinates) each; NaN where nothing was read."""
        shape = (*grid.time_s.shape, len(self.track.coordinate_names))
        values, rates = np.full(shape, np.nan), np.full(shape, np.nan)
        stds, rate_stds = np.zeros(shape), np.zeros(shape)
        known = np.isfinite(grid.time_s)
        times = np.clip(grid.time_s[known], self.track.time_s[0], self.track.time_s[-1])
        outside = np.abs(times - grid.time_s[known]) > _SILENT_S
        for column, read in enumerate(self._read):
            if read is None:
                continue
            value, rate = read.at(times)
            value[outside] = rate[outside] = np.nan
            values[known, column], rates[known, column] = value, rate
            stds[known, column] = np.interp(times, self.track.time_s, self._stds[column])
            rate_stds[known, column] = read.rate_std
        return values, rates, stds, rate_stds

    @cached_property
    def _stds(self) -> list[Floats]:
        return [np.nan_to_num(column) for column in self.track.q_std.T]

    @cached_property
    def _read(self) -> list[_Read | None]:
        return [_Read.of(self.track.time_s, column) for column in self.q.T]


@dataclass(frozen=True, eq=False)
class _Read:
    """Values between which is interpolated, but not across a silence; and their rate at the same times."""

    time_s: Floats
    value: Floats
    rate: Floats
    rate_std: float

    @staticmethod
    def of(time_s: Floats, value: Floats) -> _Read | None:
        rows = np.isfinite(value)
        if rows.sum() < _FEWEST:
            return None
        time_s, value = time_s[rows], value[rows]
        step = float(np.median(np.diff(time_s)))
        even = even_times_of_stretches(time_s, step)
        window = max(5, 2 * round(0.5 * _RATE_WINDOW_S / step) + 1)
        if len(even) <= window:
            return None
        values = np.interp(even, time_s, value)
        smooth, slope, gain = local_cubic(values, window)
        left = values - smooth
        noise = robust_std(left - np.median(left))
        return _Read(time_s, value, np.interp(time_s, even, slope / step), _LASTING * noise * gain / step)

    def at(self, time_s: Floats) -> tuple[Floats, Floats]:
        after = np.clip(np.searchsorted(self.time_s, time_s), 1, len(self.time_s) - 1)
        silent = self.time_s[after] - self.time_s[after - 1] > _SILENT_S
        value, rate = (np.interp(time_s, self.time_s, own) for own in (self.value, self.rate))
        value[silent] = rate[silent] = np.nan
        return value, rate
