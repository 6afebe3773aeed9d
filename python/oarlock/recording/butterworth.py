"""Butterworth low-pass, forward and backward, of evenly sampled rows: for markers, and for units on skin."""

from __future__ import annotations

import math

import numpy as np

from oarlock.storage.arrays import Floats

# The impulse response ends where it has fallen below the rounding of doubles.
_NEGLIGIBLE = 1e-17


def passed_twice(values: Floats, rate_hz: float, cutoff_hz: float, order: int = 4) -> Floats:
    """The rows (T, n) without what is faster than the cut-off; ends are extended by odd reflection over one period.

    Args:
        values: at least two rows, without gaps.
        rate_hz: rows per second.
        cutoff_hz: frequency at which the amplitude falls to 1/sqrt(2) after both passes, Hz.
        order: order of both passes together, even.

    Source: D. A. Winter 2009, "Biomechanics and Motor Control of Human Movement", section 3.4.4.2 (factor of two
    passes); bilinear transform with the frequencies warped.
    """
    rows = np.asarray(values, dtype=np.float64)
    pad = min(int(np.ceil(rate_hz / cutoff_hz)), len(rows) - 1)
    ends = 2.0 * rows[0] - rows[pad:0:-1], 2.0 * rows[-1] - rows[-2 : -pad - 2 : -1]
    extended = np.concatenate([ends[0], rows, ends[1]])
    response = _impulse_response(cutoff_hz, rate_hz, order)
    return _passed(_passed(extended, response)[::-1], response)[::-1][pad : pad + len(rows)]


def _passed(rows: Floats, response: Floats) -> Floats:
    """One pass; before the first row the input was constant."""
    size = 1 << (len(rows) + len(response)).bit_length()  # powers of two are the fastest
    spectrum = np.fft.rfft(rows - rows[0], size, axis=0)
    spectrum *= np.fft.rfft(response, size).reshape(-1, *[1] * (rows.ndim - 1))
    return np.asarray(rows[0] + np.fft.irfft(spectrum, size, axis=0)[: len(rows)])


def _impulse_response(cutoff_hz: float, rate_hz: float, order: int) -> Floats:
    """Response of one pass; two passes together have the requested cut-off."""
    twice, count = (math.sqrt(2.0) - 1.0) ** (-1.0 / order), order // 2
    warped = math.tan(math.pi * cutoff_hz / rate_hz) * twice
    analog = warped * np.exp(0.5j * np.pi * (2.0 * np.arange(count) + count + 1.0) / count)
    poles = (1.0 + analog) / (1.0 - analog)
    back = np.poly(poles).real
    forward = np.poly(-np.ones(count)) * back.sum() / 2.0**count
    response = [0.0] * (count + 1 + math.ceil(math.log(_NEGLIGIBLE) / math.log(np.abs(poles).max())))
    for i in range(len(response)):
        direct = forward[i] if i <= count else 0.0
        response[i] = direct - sum(back[k] * response[i - k] for k in range(1, min(i, count) + 1))
    return np.array(response)
