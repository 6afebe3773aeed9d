"""The local cubic is the filter of Savitzky and Golay."""

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from oarlock.rowing.analysis.local_cubic import local_cubic

ROUNDING = 1e-11
"""Of fits of up to 51 samples, beside values of about 100."""


@pytest.mark.parametrize("window", [5, 17, 51])
def test_local_cubic_is_savitzky_and_golays(window):
    values = np.cumsum(np.random.default_rng(window).normal(size=2000))
    value, slope, gain = local_cubic(values, window)
    np.testing.assert_allclose(value, savgol_filter(values, window, 3), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(slope, savgol_filter(values, window, 3, deriv=1), rtol=0, atol=ROUNDING)
    assert gain == pytest.approx(np.linalg.norm(savgol_coeffs(window, 3, deriv=1)), rel=ROUNDING)
