"""Clocks of sensors that do not tick together: rates, jitter, lost readings, and a drift of each clock."""

from dataclasses import replace

import numpy as np
import pytest

import oarlock
from oarlock import rowing
from oarlock_lab.bench.apart import COMMON_HZ, JITTER_S, RATES_HZ, recorded

DURATION_S, DRIFT = 20.0, 2e-4
# Blades are lifted slowly: 10 cm in half a second.
WELL_SEEN = [name for name in RATES_HZ if not name.endswith("alpha")]


@pytest.mark.long
@pytest.mark.parametrize("seed", [101, 102, 103])
def test_drifting_clocks_cost_little_when_calibrated(sculler, seed):
    motion = rowing.sculling(sculler, DURATION_S, 24, surge=False, seed=seed)
    signs = np.random.default_rng(seed).choice([-1, 1], len(RATES_HZ))
    drifts = dict(zip(RATES_HZ, DRIFT * signs, strict=True))
    drifting = recorded(sculler, motion, RATES_HZ, seed, JITTER_S, drifts)
    calibration = oarlock.calibration.calibrate_clocks(sculler, drifting)

    reference = calibration.noted["clocks"]["reference"]
    true_drift = float(np.median([drifts[name] for name in reference]))
    assert all(drifts[name] == true_drift for name in reference if name in WELL_SEEN)
    for name, clock in calibration.clocks.items():
        wrong_s = clock.offset_s + (clock.drift - drifts[name] + true_drift) * np.array([0.0, DURATION_S])
        middle_std_s = np.sqrt(clock.offset_std_s**2 - (0.5 * DURATION_S * clock.drift_std) ** 2)
        assert abs(wrong_s.mean()) < 3 * middle_std_s
        if name in WELL_SEEN:
            # Half of the 4 ms that the drift makes at either end.
            assert np.abs(wrong_s).max() < 2e-3, name

    truth, _ = oarlock.simulate(sculler, motion, ["seat"], rate_hz=100.0)
    # The reference's clock is the calibrated recording's time.
    stamped = replace(truth, time_s=np.asarray(truth.time_s) * (1 + true_drift))
    found = score(oarlock.track(sculler, drifting, calibration), stamped)
    together = score(oarlock.track(sculler, recorded(sculler, motion, COMMON_HZ, seed)), truth)
    assert found[0] < 1.2 * together[0], (found, together)
    assert abs(found[1] - together[1]) < 0.03, (found, together)


def score(track, truth):
    """Mean error of the hinges, deg, and their coverage."""
    evaluation = oarlock.evaluate(track, truth)
    joints = [j.name for j in evaluation.joints if not j.name.endswith("theta") and j.name != "seat"]
    return evaluation.mean_rmse_deg(joints), evaluation.mean_coverage(joints)
