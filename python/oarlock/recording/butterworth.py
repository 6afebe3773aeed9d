"""Butterworth low-pass, forward and backward, of evenly sampled rows: for markers, and for units on skin."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from oarlock.storage.array_gate import FloatArray


def passed_twice(values: FloatArray, rate_hz: float, cutoff_hz: float, order: int = 4) -> FloatArray:
    """The rows (T, n) without what is faster than the cut-off; ends are extended by odd reflection over one period.

    Args:
        values: at least two rows, without gaps.
        rate_hz: rows per second.
        cutoff_hz: frequency at which the amplitude falls to 1/sqrt(2) after both passes, Hz.
        order: order of both passes together, even.

    Source: D. A. Winter 2009, "Biomechanics and Motor Control of Human Movement", section 3.4.4.2 (factor of two
    passes); bilinear transform with the frequencies warped.
    """
    pad = min(int(np.ceil(rate_hz / cutoff_hz)), len(values) - 1)
    sections = _one_pass(cutoff_hz, rate_hz, order)
    return np.asarray(sosfiltfilt(sections, np.array(values), axis=0, padlen=pad))


def _one_pass(cutoff_hz: float, rate_hz: float, order: int) -> FloatArray:
    """Coefficients of one pass; two passes together have the requested cut-off."""
    twice = (np.sqrt(2.0) - 1.0) ** (-1.0 / order)
    warped = np.arctan(np.tan(np.pi * cutoff_hz / rate_hz) * twice) / np.pi * rate_hz
    return np.asarray(butter(order // 2, warped, fs=rate_hz, output="sos"))
