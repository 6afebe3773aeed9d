"""Lengths and mounts that are estimated along the way."""

import numpy as np
import pytest

import oarlock
from oarlock import Config
from oarlock.simulation import Motion

# The hinges swing in several frequencies for half a minute: enough to tell where the units sit.
TIME_S = np.linspace(0.0, 30.0, 1501)
SWING = np.stack(
    [0.8 * np.sin(2.0 * TIME_S), 0.6 * np.sin(3.1 * TIME_S + 0.4), 0.7 * np.cos(4.3 * TIME_S)], axis=1
)
BESIDE = ("gyro_bias", "accel_bias")


def recorded(model: oarlock.Model, calibration: oarlock.Calibration | None = None) -> oarlock.Recording:
    motion = Motion(tuple(model.joint_names), TIME_S, SWING)
    return oarlock.simulate(model, motion, seed=3, calibration=calibration)[1]


def test_a_wrong_length_is_found(pendulum: oarlock.Model) -> None:
    true_m = pendulum.parameters["l_upper"] + 0.03
    recording = recorded(pendulum, oarlock.Calibration(parameters={"l_upper": true_m}))
    track = oarlock.track(pendulum, recording, config=Config(structure="tree", estimate=(*BESIDE, "l_upper")))
    found = track.slow["parameters.l_upper"]
    assert found.unit == "m"
    # Five times sharper than what was known before.
    assert found.std[-1] < 0.2 * found.std[0]
    # Five standard deviations, and never worse than a fifth of what was wrong.
    assert abs(found.value[-1] - true_m) < max(5.0 * found.std[-1], 0.006)


@pytest.mark.parametrize("told_m", [1e-3, 0.0])
def test_a_length_starts_with_what_its_calibration_says_of_it(pendulum: oarlock.Model, told_m: float) -> None:
    known = oarlock.Calibration(parameter_stds={"l_upper": told_m})
    config = Config(structure="tree", estimate=(*BESIDE, "l_upper"))
    track = oarlock.track(pendulum, recorded(pendulum), known, config)
    found = track.slow["parameters.l_upper"]
    assert np.isfinite(track.q).all()
    # Readings only sharpen it; what is told to be exact stays.
    assert (found.std <= max(told_m, 1e-6) * (1.0 + 1e-9)).all()
    assert abs(found.value - pendulum.parameters["l_upper"]).max() < max(5.0 * told_m, 1e-6)


def test_a_mount_askew_about_the_hinges_axis_is_found(pendulum: oarlock.Model) -> None:
    described = pendulum.describe().sensors
    name = described[-1].name
    mount = described[-1].mount
    askew = np.deg2rad(4.0)
    turn = np.array(
        [[1.0, 0.0, 0.0], [0.0, np.cos(askew), -np.sin(askew)], [0.0, np.sin(askew), np.cos(askew)]]
    )
    worn = oarlock.Calibration(mounts={name: (np.asarray(mount.rotation) @ turn, mount.offset)})
    track = oarlock.track(
        pendulum, recorded(pendulum, worn), config=Config(structure="tree", estimate=(*BESIDE, "mounts"))
    )
    found = track.slow[f"{name}.mount_rx"]
    assert found.unit == "rad"
    # A tenth of what it was off.
    assert abs(found.value[-1] - askew) < 0.1 * askew


def test_a_name_that_is_no_length_is_refused(pendulum: oarlock.Model) -> None:
    with pytest.raises(oarlock.DataError, match=r"l_uper.*lengths.*mounts.*l_upper"):
        oarlock.track(pendulum, recorded(pendulum), config=Config(structure="tree", estimate=("l_uper",)))
