"""`world_from_sensor`: orientation of a unit from gyroscope and accelerometer, for the searches of hinges.

A complementary filter: the gyroscope is integrated, and turned slowly so that the accelerometer's mean points up.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock.recording.streams import ImuStream

TIME_CONSTANT_S = 3.0
"""Longer than the accelerations of ordinary movement, shorter than the drift of the inclination."""


def world_from_sensor(stream: ImuStream, still_s: tuple[float, float], time_s: Floats) -> Floats:
    """(N, 3, 3) at `time_s`, with z up and an arbitrary heading.

    Args:
        stream: gyroscope and accelerometer.
        still_s: where the unit is at rest; its mean rate there is the gyroscope's bias.
        time_s: (N,) s, inside the stream's.
    """
    assert stream.gyro_rad_s is not None and stream.accel_m_s2 is not None
    known = np.isfinite(stream.gyro_rad_s).all(axis=1) & np.isfinite(stream.accel_m_s2).all(axis=1)
    at_s, gyro, accel = stream.time_s[known], stream.gyro_rad_s[known], stream.accel_m_s2[known]
    rest = (at_s >= still_s[0]) & (at_s <= still_s[1])
    gyro = gyro - gyro[rest].mean(axis=0)
    steps_s = np.diff(at_s)
    turns = matrix_from_quat(quat_from_rotvec(0.5 * (gyro[1:] + gyro[:-1]) * steps_s[:, None]))
    up = accel[rest].mean(axis=0)
    x, y, z = up / np.linalg.norm(up)
    across = math.hypot(x, y)
    angle = math.atan2(across, z)
    now = _turn(angle * y / across, -angle * x / across) if across else _turn(angle, 0.0)
    found = np.empty((len(at_s), 3, 3))
    found[0] = now
    for k, (turn, step_s) in enumerate(zip(turns, steps_s, strict=True), start=1):
        now = now @ turn
        x, y, z = now @ accel[k] / np.linalg.norm(accel[k])
        gain = min(1.0, step_s / TIME_CONSTANT_S)
        # The small turn that takes the measured vertical towards z.
        now = _turn(gain * y, -gain * x) @ now if z > 0 else now
        found[k] = now
    nearest = np.clip(np.searchsorted(at_s, time_s), 0, len(at_s) - 1)
    return found[nearest]


def _turn(x: float, y: float) -> Floats:
    """(3, 3) of a rotation vector in the plane; a row at a time, `quat_from_rotvec` takes ten times as long."""
    angle = math.hypot(x, y)
    sine, cosine = (math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2) if angle else (1.0, 0.5)
    across = cosine * x * y
    return np.array(
        [
            [1.0 - cosine * y * y, across, sine * y],
            [across, 1.0 - cosine * x * x, -sine * x],
            [-sine * y, sine * x, 1.0 - cosine * angle**2],
        ]
    )
