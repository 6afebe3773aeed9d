"""Cubics through the neighbours of each sample (Savitzky and Golay, Anal. Chem. 36, 1964), for slopes of strokes."""

from __future__ import annotations

import numpy as np

from oarlock.storage.arrays import Floats


def local_cubic(values: Floats, window: int) -> tuple[Floats, Floats, float]:
    """Values (T,) and slopes (T,), a sample, of the cubic through `window` samples about each; `window` is odd.

    Half a window from the ends it is the cubic of the first or last window. The third number is the standard deviation
    of a slope for white noise of one. As `scipy.signal.savgol_filter`, which takes 0.3 s to import.
    """
    half = window // 2
    powers = np.vander(np.arange(-half, half + 1.0), 4, increasing=True)
    slopes = powers[:, :3] * [1.0, 2.0, 3.0]
    fit = np.linalg.pinv(powers)
    first, last = fit @ values[:window], fit @ values[-window:]
    value = [powers[:half] @ first, np.correlate(values, fit[0], "valid"), powers[half + 1 :] @ last]
    slope = [slopes[:half] @ first[1:], np.correlate(values, fit[1], "valid"), slopes[half + 1 :] @ last[1:]]
    return np.concatenate(value), np.concatenate(slope), float(np.linalg.norm(fit[1]))
