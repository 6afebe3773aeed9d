"""Offsets of units on strapdown links, from how well joints close."""

import numpy as np
import pytest

import oarlock
from hit_body import hit_body

LATE_S = 0.010
WITHIN_S = 0.003


@pytest.mark.parametrize("seed", [2, pytest.param(3, marks=pytest.mark.long)])
def test_a_unit_that_reports_late_is_found(seed):
    """Hits are shorter than two samples, so not every such body shows a lag; these move enough beside them."""
    body = hit_body(30.0, 0.01, seed=seed)
    late = [
        oarlock.recording.ImuStream(
            stream.name,
            stream.time_s + 1e-6 * k + (LATE_S if stream.name == "upper_arm_l" else 0.0),
            gyro_rad_s=stream.gyro_rad_s,
            accel_m_s2=stream.accel_m_s2,
        )
        for k, stream in enumerate(body.recording)
    ]
    found = oarlock.calibration.calibrate_clocks(body.model, oarlock.Recording(late), body.calibration)
    offset_s = {name: clock.offset_s for name, clock in found.clocks.items()}
    others = np.mean([offset for name, offset in offset_s.items() if name != "upper_arm_l"])
    assert abs(offset_s["upper_arm_l"] - others - LATE_S) < WITHIN_S, offset_s
    assert all(clock.offset_std_s > 0.0 for clock in found.clocks.values())
