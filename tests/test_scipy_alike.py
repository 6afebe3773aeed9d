"""What the package computes itself, so that it does not need scipy, is what scipy computes."""

import numpy as np
import pytest
from scipy import signal, special, stats
from scipy.spatial.transform import Rotation

from oarlock.calibration.static.inclination import _turn
from oarlock.model.rotation import quat_from_matrix
from oarlock.movement.cycles import peaks_of
from oarlock.recording.butterworth import passed_twice
from oarlock.storage.statistics import (
    chi2_quantile,
    f_tail,
    range_quantile,
    student_quantile,
    student_tail,
)

LOG_GAMMA = 1e-8
"""Of differences of log gamma at a million degrees of freedom, where they cancel."""


@pytest.mark.parametrize("probability", [0.025, 0.5, 0.975, 0.9999])
def test_quantiles_of_chi_square(probability):
    degrees = np.array([[0.5, 1, 2, 3, 10, 30], [300, 999, 1000, 5000, 1e5, 1e7]])
    expected = 2.0 * special.gammaincinv(degrees / 2.0, probability)
    # Near 1 the probability itself is known to 1e-16 of 1 only.
    np.testing.assert_allclose(chi2_quantile(probability, degrees), expected, rtol=1e-10)
    assert chi2_quantile(probability, 7.0).shape == ()


@pytest.mark.parametrize("degrees", [1, 2, 2.5, 7, 30, 200, 1e4, 1e6])
def test_students_t(degrees):
    for t in (0.0, 0.1, 1.0, 2.0, 5.0, 20.0):
        assert student_tail(t, degrees) == pytest.approx(special.stdtr(degrees, -t), rel=LOG_GAMMA)
        assert student_tail(-t, degrees) == student_tail(t, degrees)
    for probability in (1e-6, 0.3, 0.9, 0.975, 0.9999):
        expected = special.stdtrit(degrees, probability)
        assert student_quantile(probability, degrees) == pytest.approx(expected, rel=LOG_GAMMA)


@pytest.mark.parametrize(
    ("above", "below", "ratio"), [(1, 1, 0.3), (3, 10, 2.0), (20, 300, 1.4), (5, 2000, 0.1)]
)
def test_tails_of_f(above, below, ratio):
    assert f_tail(above, below, ratio) == pytest.approx(special.fdtrc(above, below, ratio), rel=1e-10)


@pytest.mark.parametrize("count", [2, 6, 40, 500])
def test_ranges_of_normal_numbers(count):
    for probability in (0.95, 0.999):
        expected = stats.studentized_range.ppf(probability, count, np.inf)
        assert range_quantile(probability, count) == pytest.approx(expected, rel=1e-10)


def test_peaks():
    random = np.random.default_rng(0)
    for _ in range(200):
        course = np.round(np.cumsum(random.normal(size=400)), random.integers(0, 3))  # with flat tops
        distance, prominence = random.uniform(1, 40), random.uniform(0, 5)
        expected, _ = signal.find_peaks(course, distance=distance, prominence=prominence)
        np.testing.assert_array_equal(peaks_of(course, prominence, distance), expected)
    assert peaks_of(np.zeros(5), 0.0).size == peaks_of(np.zeros(1), 0.0).size == 0


@pytest.mark.parametrize(
    ("rows", "rate_hz", "cutoff_hz", "order"),
    [(2, 100, 6, 4), (5000, 100, 6, 4), (5000, 100, 20, 2), (300, 100, 6, 8), (5000, 1000, 0.5, 4)],
)
def test_low_pass(rows, rate_hz, cutoff_hz, order):
    values = np.cumsum(np.random.default_rng(rows).normal(size=(rows, 3)), axis=0) + 9.8
    twice = (np.sqrt(2.0) - 1.0) ** (-1.0 / order)
    warped = np.arctan(np.tan(np.pi * cutoff_hz / rate_hz) * twice) / np.pi * rate_hz
    sections = signal.butter(order // 2, warped, fs=rate_hz, output="sos")
    pad = min(int(np.ceil(rate_hz / cutoff_hz)), rows - 1)
    expected = signal.sosfiltfilt(sections, values, axis=0, padlen=pad)
    # The recursion's own rounding grows with the length of its memory, 1000 rows at 0.5 Hz.
    np.testing.assert_allclose(passed_twice(values, rate_hz, cutoff_hz, order), expected, atol=1e-8)
    one = passed_twice(values[:, 0], rate_hz, cutoff_hz, order)
    np.testing.assert_allclose(one, expected[:, 0], atol=1e-8)


def test_quaternions_of_matrices():
    half_turns = [np.diag(d) for d in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1], [1, 1, 1])]
    matrices = np.concatenate([Rotation.random(2000, rng=1).as_matrix(), half_turns])
    expected = Rotation.from_matrix(matrices).as_quat()[:, [3, 0, 1, 2]]
    found = quat_from_matrix(matrices)
    signs = np.sign(np.sum(found * expected, axis=1, keepdims=True))
    np.testing.assert_allclose(found * signs, expected, atol=1e-15)
    matrices[3, 1, 1] = np.nan
    assert np.isnan(quat_from_matrix(matrices)[3]).all() and np.isfinite(quat_from_matrix(matrices)[4]).all()


def test_turns_in_a_plane():
    for x, y in ((0.0, 0.0), (1e-9, -2e-9), (0.3, -1.2), (np.pi, 0.0)):
        np.testing.assert_allclose(_turn(x, y), Rotation.from_rotvec([x, y, 0.0]).as_matrix(), atol=1e-15)
