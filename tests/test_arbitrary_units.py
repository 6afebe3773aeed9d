"""Magnetometers in arbitrary units: their scale and what is said about it."""

import numpy as np
import pytest

from oarlock import DataError
from oarlock.formats.arbitrary_units import NOMINAL_FIELD_UT, mag_factor, scale_meta, scaled_mag


def test_the_median_norm_becomes_the_nominal_field_and_directions_stay():
    rng = np.random.default_rng(3)
    field = rng.normal(size=(301, 3))
    field /= np.linalg.norm(field, axis=1)[:, None]
    mag = 0.8 * field
    mag[10:20] = np.nan
    mag_ut, note = scaled_mag(mag, "shank")
    norms = np.linalg.norm(mag_ut, axis=1)
    assert np.nanmedian(norms) == pytest.approx(NOMINAL_FIELD_UT, rel=1e-12)
    assert np.isnan(mag_ut[10:20]).all() and np.isfinite(mag_ut[20:]).all()
    np.testing.assert_allclose(mag_ut / NOMINAL_FIELD_UT, np.where(np.isnan(mag), np.nan, field), atol=1e-12)
    assert note.startswith("shank: ") and "1 unit = 62.5 uT" in note and "calibrate field" in note


@pytest.mark.parametrize(
    "mag", [np.zeros((4, 3)), np.full((4, 3), np.nan), np.zeros((0, 3)), np.full((3, 3), 1e-322)]
)
def test_a_magnetometer_without_readings_is_left_out(mag):
    mag_ut, note = scaled_mag(mag)
    assert mag_ut is None and "left out" in note
    assert mag_factor(mag) is None


def test_another_shape_is_refused_by_name():
    with pytest.raises(DataError, match="shank, readings in arbitrary units"):
        scaled_mag(np.zeros((4, 2)), "shank")


def test_the_factors_are_kept_for_the_recording():
    mags = {"shank": np.full((5, 3), 1.0), "foot": None, "thigh": np.zeros((5, 3))}
    assert dict(scale_meta(mags)) == {"mag_scale": {"shank": pytest.approx(50.0 / np.sqrt(3.0))}}
    assert dict(scale_meta({"foot": None})) == {}
