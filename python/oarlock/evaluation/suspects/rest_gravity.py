"""Gravity in units that rest: a change of readings that contradicts it corrects no fault. For both searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.session.unit_rows import UnitRows
from oarlock.calibration.static.pose_mounts import rest_posture
from oarlock.calibration.static.worn_model import Worn
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.recording import Recording

AGREES_RAD, WORSE_RAD = np.radians(20.0), np.radians(10.0)
"""Angle from gravity up to which a link is in its rest posture, and by how much a change may enlarge it."""
LEAST_STILL_S = 0.5
GRAVITY_WITHIN_M_S2 = 0.5
"""Difference from gravity up to which the force on a unit is that of rest."""


@dataclass(frozen=True, eq=False)
class RestGravity:
    """Up in the axes of each unit where its link is in the rest posture, and the force on it while it rests.

    Args:
        expected: unit -> (3,) up, by its mount.
        rests: unit -> start of each rest, s, and mean force (3,), m/s2.
    """

    expected: Mapping[str, Floats]
    rests: Mapping[str, Sequence[tuple[float, Floats]]]

    @classmethod
    def of(cls, model: Model, recording: Recording, calibration: Calibration | None) -> RestGravity:
        """Of the units that have a gyroscope and an accelerometer."""
        worn = Worn.of(model, calibration)
        world, frames = worn.model.describe().world, worn.model.frame_names
        poses = worn.model.forward_kinematics(rest_posture(worn.model, None))
        up = np.asarray(world.up)
        expected, rests = {}, {}
        sensors = {sensor.name: sensor for sensor in worn.model.describe().inertial_units}
        for stream in recording:
            sensor = sensors.get(stream.name)
            if sensor is None or not {"gyro_rad_s", "accel_m_s2"} <= set(stream.values):
                continue
            assert isinstance(stream, ImuStream)
            link = poses[frames.index(sensor.frame), :3, :3]
            expected[stream.name] = worn.rotations[stream.name].T @ link.T @ up
            rests[stream.name] = _rests(UnitRows.of(stream), world.gravity_m_s2)
        return cls(expected, rests)

    def contradicts(self, names: Sequence[str], of_force: Floats | None, from_s: float | None = None) -> bool:
        """Whether a unit that rests agrees with gravity, and would not with its force times a matrix (3, 3)."""
        if of_force is None:
            return False
        angles = [
            [_angle(f, self.expected[name]) for f in (force, of_force @ force)]
            for name in names
            for start_s, force in self.rests.get(name, ())
            if from_s is None or start_s >= from_s
        ]
        return any(before < AGREES_RAD and after > before + WORSE_RAD for before, after in angles)


def _rests(unit: UnitRows, gravity_m_s2: float) -> list[tuple[float, Floats]]:
    means = [
        (start_s, unit.accel[unit.rows((start_s, end_s))].mean(axis=0))
        for start_s, end_s in unit.still(worn=True)
        if end_s - start_s >= LEAST_STILL_S
    ]
    return [
        (start_s, mean)
        for start_s, mean in means
        if abs(float(np.linalg.norm(mean)) - gravity_m_s2) < GRAVITY_WITHIN_M_S2
    ]


def _angle(one: Floats, other: Floats) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
