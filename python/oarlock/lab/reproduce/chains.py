"""Chain models of any size with recordings, on which `cost` measures the time of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock import Model, Motion, Recording
from oarlock.simulation.simulate import simulate

RATE_HZ = 125.0
_HEAD = """
format = 1
name = "chain_{joints}_{units}"

[world]
up = [0, 0, 1]
forward = [1, 0, 0]
gravity_m_s2 = 9.80665
magnetic_norm_ut = 47.0
magnetic_dip_rad = 1.05
magnetic_azimuth_rad = 0.4
azimuth_fixed = true

[process]
hinge = {{ kind = "jerk", density = 11.2, start_std = [0.2, 0.5, 5.0] }}
"""
_LINK = """
[[joint]]
name = "j{k}"
kind = "hinge"
limits = [-2, 2]

[[frame]]
name = "f{k}"
parent = "{parent}"
dh = {{ a = 0.15, alpha = "{turn}", d = 0, theta = 0 }}
joint = "j{k}"
"""
_UNIT = """
[[sensor]]
name = "unit{k}"
kind = "imu"
frame = "f{frame}"
mount.offset = [0.02, 0.01, 0.0]
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.01
mag_std_ut = 1.0
"""


@dataclass(frozen=True)
class Size:
    """Number of hinges and inertial units of nine rows; a tree has arms of `arm` links, 0 is a single chain."""

    joints: int
    units: int
    arm: int = 0

    @property
    def states(self) -> int:
        """N."""
        return 3 * self.joints

    @property
    def readings(self) -> int:
        """M."""
        return 9 * self.units


def model_text(size: Size) -> str:
    """A chain or tree of hinges with alternating axes and evenly distributed units, the last one at the end."""
    parts = [_HEAD.format(joints=size.joints, units=size.units)]
    for k in range(size.joints):
        starts = k == 0 or (size.arm > 0 and k % size.arm == 0)
        turn = ("pi/2", "-pi/2", "pi/3")[k % 3]
        parts.append(_LINK.format(k=k, parent="root" if starts else f"f{k - 1}", turn=turn))
    for k in range(size.units):
        frame = ((k + 1) * size.joints) // size.units - 1 if size.units <= size.joints else k % size.joints
        parts.append(_UNIT.format(k=k, frame=max(frame, 0)))
    return "".join(parts)


def built(size: Size, samples: int, seed: int = 0) -> tuple[Model, Recording, list[float]]:
    """A model, a recording of a slow swing of all its joints, and the start posture."""
    model = Model.from_toml(model_text(size), f"chain_{size.joints}_{size.units}.toml", {})
    random = np.random.default_rng([seed, size.joints, size.units])
    time_s = np.linspace(0.0, samples / RATE_HZ + 0.1, max(8, int(25 * samples / RATE_HZ) + 8))
    phase = random.uniform(0.0, 2.0 * np.pi, size.joints)
    q = 0.3 * np.sin(2.0 * np.pi * 0.7 * time_s[:, None] + phase) + random.uniform(-0.3, 0.3, size.joints)
    motion = Motion(tuple(model.joint_names), time_s, q)
    truth, recording = simulate(model, motion, rate_hz=RATE_HZ, seed=seed)
    return model, recording, [float(v) for v in truth.q[0]]
