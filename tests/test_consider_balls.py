"""Bands by a wrong mount on a ball joint, against differences of tracks with other mounts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock

STILL = {"gate": False, "learning_memory_s": None, "magnetometer": "on"}
"""The filter is then nearly linear in a small error of a mount."""
MOUNT_STD_RAD = 0.1
"""Of a mount whose model file says nothing."""
STEP_RAD = 1e-3
TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
MOST_RATIO = 3.0
"""Of the bands' width to that of the differences, both ways, for each axis. About the vertical the start counts: the
heading is known to 40 deg, and its slopes leave out that the gain changes (1.1 to 2.5). Slopes that turned with the
carrier's axes instead of the body's own grew to 5 to 20."""
BODY = """\
format = 1
name = "trunk"
joint = [{ name = "trunk", kind = "ball" }]
frame = [{ name = "thorax", parent = "root", joint = "trunk", transform.translation = [0.0, 0.1, 0.0] }]
[world]
up = "y"
forward = "x"
magnetic_norm_ut = 47.0
magnetic_dip_rad = 1.05
magnetic_azimuth_rad = 0.4
[process]
ball = { kind = "jerk", density = 40.0, start_std = [0.3, 0.5, 5.0] }
[[sensor]]
name = "back"
kind = "imu"
frame = "thorax"
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.05
mag_std_ut = 0.8
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    file = tmp_path_factory.mktemp("ball") / "trunk.toml"
    file.write_text(BODY, encoding="utf-8")
    return oarlock.load_model(file)


def waving(model, seed):
    """Up to some 20 deg and 35 deg/s about all axes."""
    time_s = np.arange(0.0, 8.5, 0.02)
    phase = np.outer(time_s, [1.6, 0.7, 1.1]) + np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 3)
    quats = Rotation.from_rotvec(0.35 * np.sin(phase)).as_quat(scalar_first=True)
    motion = oarlock.Motion.from_joints(time_s, {"trunk": quats})
    return oarlock.simulate(model, motion, seed=seed, rate_hz=50.0)[1]


def turned(model, recording, config, rotvec_rad):
    """The track with a mount that is turned by so much."""
    (mount,) = (unit.mount for unit in model.describe().inertial_units)
    rotation = np.asarray(mount.rotation) @ Rotation.from_rotvec(rotvec_rad).as_matrix()
    return oarlock.track(
        model, recording, oarlock.Calibration(mounts={"back": (rotation, mount.offset)}), config
    )


def differences_rad(model, recording, config):
    """(T, 3) what a mount that is wrong by one standard deviation about each axis does, root of the sum of squares."""
    variance = 0.0
    for step in STEP_RAD * np.eye(3):
        one, other = (
            Rotation.from_rotvec(np.array(turned(model, recording, config, s).q)) for s in (step, -step)
        )
        variance += (MOUNT_STD_RAD * (other.inv() * one).as_rotvec() / (2.0 * STEP_RAD)) ** 2
    return np.sqrt(variance)


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_a_wrong_mount_of_a_ball_widens_the_bands_by_what_it_does(model, seed):
    recording = waving(model, seed)
    config = oarlock.Config(filter="ekf", consider="always", **STILL)
    whole = turned(model, recording, config, np.zeros(3))
    noise = oarlock.track(model, recording, None, oarlock.Config(filter="ekf", consider="off", **STILL))
    rows = np.searchsorted(whole.time_s, TIMES_S)
    considered = np.sqrt(whole.q_std[rows] ** 2 - noise.q_std[rows] ** 2)
    ratio = considered / differences_rad(model, recording, config)[rows]
    print(seed, np.round(ratio, 2).tolist())
    assert np.maximum(ratio, 1.0 / ratio).max() < MOST_RATIO
