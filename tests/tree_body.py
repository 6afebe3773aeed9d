"""Bodies on ball joints and hinges with a unit each, moving in all directions, and how far a calibration is off."""

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock

TREE = """
format = 1
name = "tree"

[world]
up = "z"
forward = "x"
magnetic_norm_ut = "field_norm_ut"
magnetic_dip_rad = "field_dip_rad"

[parameters]
field_norm_ut = { default = 47.0, unit = "" }
field_dip_rad = { default = 1.0, unit = "rad" }
arm_x = { default = 0.25, unit = "m" }
arm_y = { default = 0.0, unit = "m" }
arm_z = { default = 0.0, unit = "m" }
leg = { default = 0.3, unit = "m" }

[process]
ball = { kind = "jerk", density = 100.0, start_std = [0.2, 2.0, 20.0] }

[[joint]]
name = "whole"
kind = "ball"

[[joint]]
name = "shoulder"
kind = "ball"

[[joint]]
name = "elbow"
kind = "hinge"
rest = 0.4

[[joint]]
name = "knee"
kind = "hinge"

[[frame]]
name = "trunk"
parent = "root"
joint = "whole"
transform = { translation = [0, 0, 0] }

[[frame]]
name = "upper"
parent = "trunk"
joint = "shoulder"
transform = { translation = ["arm_x", "arm_y", "arm_z"] }

[[frame]]
name = "lower"
parent = "upper"
joint = "elbow"
axis = "y"
transform = { translation = [0.28, 0, 0] }

[[frame]]
name = "shank"
parent = "trunk"
joint = "knee"
axis = "x"
transform = { translation = [0, 0, "-leg"] }
"""
UNITS = {"trunk": [0, 0, 0], "upper": [0.1, 0, 0.03], "lower": [0.1, 0, 0.03], "shank": [0, 0, -0.2]}
SENSOR = """
[[sensor]]
name = "{name}"
kind = "imu"
frame = "{name}"
mount.offset = {offset}
gyro_std_rad_s = 0.005
accel_std_m_s2 = 0.05
mag_std_ut = 0.3
"""
PUSH = """
[[base_acceleration]]
name = "push_{axis}"
axis = "{axis}"
density = 50.0
start_std = 5.0
"""
TEXT = (
    TREE
    + "".join(SENSOR.format(name=n, offset=o) for n, o in UNITS.items())
    + "".join(PUSH.format(axis=a) for a in "xyz")
)


def tree(folder):
    """The model, written as a file and read from it."""
    file = folder / "tree.toml"
    file.write_text(TEXT, encoding="utf-8")
    return oarlock.load_model(file)


def waving(model, seconds=40.0, amplitude=0.35, still_s=0.0, seed=0):
    """Every coordinate on waves of its own, the root pushed about; at rest in the model's posture until `still_s`."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, seconds + still_s, 0.01)
    moving = np.clip(time_s - still_s, 0.0, None)
    rise = np.clip(moving, 0.0, 1.0)
    onset = rise**4 * (35 - 84 * rise + 70 * rise**2 - 20 * rise**3)

    def waves(columns, size):
        hertz, phase = random.uniform(0.25, 1.1, (2, columns)), random.uniform(0.0, 2 * np.pi, (2, columns))
        pairs = np.sin(2 * np.pi * hertz * moving[:, None, None] + phase) - np.sin(phase)
        return size * pairs.sum(axis=1) * onset[:, None]

    rest = np.concatenate([np.ravel(j.rest) for j in model.describe().joints])
    return oarlock.simulation.Motion(
        tuple(model.coordinate_names),
        time_s,
        waves(len(rest), amplitude) + rest,
        waves(3, 1.5) if model.describe().base_acceleration else None,
    )


def recorded(model, true, noise=True, **motion):
    """The recording of a wearing that is `true`; biases of 5 mrad/s and 0.05 m/s2 with the noise."""
    return oarlock.simulate(
        model,
        waving(model, **motion),
        rate_hz=100.0,
        calibration=true,
        noise=noise,
        gyro_bias_rad_s=0.005 if noise else 0.0,
        accel_bias_m_s2=0.05 if noise else 0.0,
    )[1]


def turn(calibration, true, name):
    """Rotation vector (3,) rad in link axes from the true mount to the found one."""
    return Rotation.from_matrix(calibration.mounts[name][0] @ true.mounts[name][0].T).as_rotvec()


def place(calibration, true, name):
    """Error of a unit's place (3,) m."""
    return calibration.mounts[name][1] - true.mounts[name][1]
