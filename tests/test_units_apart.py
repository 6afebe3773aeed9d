"""Units of one body that sample at different times, without a compass to say where north is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from local_data import local_folder
from oarlock import Config, Recording
from oarlock.formats.datasets.dfjimu import BODIES, read_dfjimu, read_dfjimu_reference
from oarlock_lab.validation import ours
from oarlock_lab.validation.scores import relative_error_rad, rmse_deg

pytestmark = pytest.mark.data

SETTLED_S = 10.0
# The headings are found through what both units feel. A spline of readings at 50 Hz has lost some of it; where
# the push could jump between samples, 2.4 deg became 6 to 22.
COSTS_DEG = 1.0


def sampled_later(stream, delay_s):
    """What the unit would have read so much later, with stamps that say so."""
    at_s = stream.time_s + delay_s
    at_s = at_s[at_s <= stream.time_s[-1]]
    gyro, accel = (CubicSpline(stream.time_s, v)(at_s) for v in (stream.gyro_rad_s, stream.accel_m_s2))
    return replace(stream, time_s=at_s, gyro_rad_s=gyro, accel_m_s2=accel)


def error_deg(recording, reference, **settings):
    config = Config(**{**ours.WITH_LENGTHS.to_dict(), **settings})
    estimate = next(ours.track_dfjimu(recording, config))
    return rmse_deg(relative_error_rad(estimate, reference, BODIES), reference.time_s > SETTLED_S)


@pytest.mark.long
@pytest.mark.parametrize("trial", ["2D_01", "3D_05"])
@pytest.mark.parametrize("delay_s", [0.002, 0.006])
def test_units_that_sample_apart_find_their_heading_all_the_same(trial, delay_s):
    file = local_folder("data/dfjimu") / f"data_{trial}.mat"
    together, reference = read_dfjimu(file), read_dfjimu_reference(file)
    assert np.diff(together[BODIES[0]].time_s).mean() == pytest.approx(0.02, rel=0.01)
    late = sampled_later(together[BODIES[1]], delay_s)
    apart = Recording([together[BODIES[0]], late], together.meta)
    found, known = error_deg(apart, reference, sample_rate_hz=0.0), error_deg(together, reference)
    print(f"{trial}, {1e3 * delay_s:g} ms apart: {found:.2f} deg, together {known:.2f}")
    assert found < known + COSTS_DEG


@pytest.mark.long
@pytest.mark.parametrize("trial", ["2D_01", "3D_05"])
def test_the_sampling_that_tracking_finds_is_as_good(trial):
    file = local_folder("data/dfjimu") / f"data_{trial}.mat"
    together, reference = read_dfjimu(file), read_dfjimu_reference(file)
    late = sampled_later(together[BODIES[1]], 0.002)
    apart = Recording([together[BODIES[0]], late], together.meta)
    found, every = error_deg(apart, reference), error_deg(apart, reference, sample_rate_hz=0.0)
    print(f"{trial}: {found:.2f} deg with the samples that are found, {every:.2f} at every instant")
    assert found < error_deg(together, reference) + COSTS_DEG
    # The same samples, with rows between them at other times.
    assert found == pytest.approx(every, rel=0.05)
