"""Periodic curves and slow random variation from which simulated strokes are built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock.storage.arrays import Floats

_NEGLIGIBLE = 1e-13
_GRID = 8192
_VARIATION_WIDTH = 0.6
_VARIATION_REACH = 5


@dataclass(frozen=True, eq=False)
class PeriodicCurve:
    """A finite Fourier series of period 1, hence smooth in all derivatives.

    ``coefficients`` (H+1,) are complex; the value is the real part of sum c_n exp(2 pi i n u).
    """

    coefficients: NDArray[np.complex128]

    @classmethod
    def through(cls, points: Sequence[tuple[float, float]], smoothing: float) -> PeriodicCurve:
        """The closed polyline of (phase, value) points, smoothed by a Gaussian.

        Args:
            points: phases in [0, 1), increasing, with their values.
            smoothing: standard deviation of the Gaussian, in periods.
        """
        phase, value = np.array(points, dtype=np.float64).T
        gaps = np.diff(phase, append=phase[0] + 1.0)
        slopes = (np.roll(value, -1) - value) / gaps
        bends = slopes - np.roll(slopes, 1)
        mean = float(np.sum(gaps * (value + np.roll(value, -1))) / 2.0)
        harmonics = int(np.ceil(np.sqrt(-np.log(_NEGLIGIBLE) / 2.0) / (np.pi * smoothing)))
        order = np.arange(1, harmonics + 1)[:, None]
        # The second derivative of a polyline is one impulse a corner, so its series is exact.
        series = -2.0 * np.exp(-2j * np.pi * order * phase) @ bends / (2.0 * np.pi * order[:, 0]) ** 2
        series *= np.exp(-2.0 * (np.pi * smoothing * order[:, 0]) ** 2)
        return cls(np.concatenate([[mean + 0j], series]))

    def normalised(self) -> PeriodicCurve:
        """The same curve, shifted and scaled to reach from 0 to 1."""
        values = self(np.arange(_GRID) / _GRID)
        low, high = float(values.min()), float(values.max())
        coefficients = self.coefficients.copy()
        coefficients[0] -= low
        return PeriodicCurve(coefficients / (high - low))

    def __call__(self, phase: Floats) -> Floats:
        """Values at ``phase`` (any shape), in periods."""
        turn = np.exp(2j * np.pi * phase)
        total = np.full(turn.shape, self.coefficients[-1])
        for coefficient in self.coefficients[-2::-1]:
            total = total * turn + coefficient
        return np.asarray(total.real, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Variation:
    """Seeded stroke-to-stroke variation: smooth, zero mean, standard deviation 1.

    One random number a stroke, blended by Gaussians 0.6 strokes wide.
    """

    rng: np.random.Generator
    strokes: Floats

    def draw(self, scale: float) -> Floats:
        """One independent curve over ``strokes``, with standard deviation ``scale``."""
        nearest = np.rint(self.strokes).astype(np.int64)
        first = int(nearest.min()) - _VARIATION_REACH
        numbers = self.rng.standard_normal(int(nearest.max()) + _VARIATION_REACH + 1 - first)
        total = np.zeros_like(self.strokes)
        for shift in range(-_VARIATION_REACH, _VARIATION_REACH + 1):
            distance = self.strokes - (nearest + shift)
            total += numbers[nearest + shift - first] * np.exp(-0.5 * (distance / _VARIATION_WIDTH) ** 2)
        return np.asarray(scale * total / np.sqrt(_VARIATION_WIDTH * np.sqrt(np.pi)), dtype=np.float64)
