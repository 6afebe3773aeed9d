"""A model's description as a MuJoCo body whose gyroscopes and accelerometers can be read along a motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock.model import (
    FrameDescription,
    ImuDescription,
    ModelDescription,
    TransformDescription,
    WorldDescription,
)
from oarlock.storage.arrays import Floats

WAYS = np.eye(3)


class MujocoBody:
    """Every frame is a body where its joint acts and a fixed one behind it; every unit is a site.

    A joint that moves several frames is there once for each of them, with that frame's sign. The root hangs on three
    slides, which take the base's acceleration, and may rock about axes through a pivot, one turn after the other.
    Masses only have to be there, for accelerations are imposed.
    """

    def __init__(
        self,
        description: ModelDescription,
        rocks_about: Sequence[Floats] = (),
        pivot_m: Floats | None = None,
    ) -> None:
        reason = "the oracle mujoco is not installed: pip install -r requirements/dev.txt"
        self.mujoco: Any = pytest.importorskip("mujoco", reason=reason)
        self.kinds = {joint.name: joint.kind for joint in description.joints}
        self.columns = _columns(description)
        self.frames = [frame for frame in description.frames if frame.joint is not None]
        self.units = list(description.inertial_units)
        spec = self.mujoco.MjSpec()
        world = description.world
        spec.option.gravity = -world.gravity_m_s2 * np.asarray(world.up)
        spec.option.magnetic = field_ut(world)
        ends = {"root": self._root(spec, rocks_about, pivot_m)}
        for frame in description.frames:
            if frame.parent is not None:
                ends[frame.name] = self._frame(ends[frame.parent], frame)
        for unit in self.units:
            self._unit(spec, ends[unit.frame], unit)
        self.model = spec.compile()
        self.data = self.mujoco.MjData(self.model)

    def _root(self, spec: Any, rocks_about: Sequence[Floats], pivot_m: Floats | None) -> Any:
        root, kinds = self._body(spec.worldbody, "root", None), self.mujoco.mjtJoint
        for name, axis in zip("xyz", WAYS, strict=True):
            root.add_joint(name=f"root {name}", type=kinds.mjJNT_SLIDE, axis=axis)
        self.rocks = [f"root turn {k}" for k in range(len(rocks_about))]
        for name, axis in zip(self.rocks, rocks_about, strict=True):
            root.add_joint(name=name, type=kinds.mjJNT_HINGE, axis=axis, pos=pivot_m)
        return root

    def _frame(self, parent: Any, frame: FrameDescription) -> Any:
        moved = self._body(parent, f"{frame.name} moved", frame.before)
        for name, kind, axis in self._joints(frame):
            moved.add_joint(name=name, type=kind, axis=axis)
        return self._body(moved, frame.name, frame.after)

    def _joints(self, frame: FrameDescription) -> list[tuple[str, Any, Floats]]:
        """MuJoCo's joints of one frame; a free joint is three slides and a ball, for only the world may hold one."""
        if frame.joint is None:
            return []
        kinds, name, kind = self.mujoco.mjtJoint, frame.name, self.kinds[frame.joint]
        slides = [(f"{name} {way}", kinds.mjJNT_SLIDE, axis) for way, axis in zip("xyz", WAYS, strict=True)]
        ball = [(f"{name} turn", kinds.mjJNT_BALL, WAYS[2])]
        along_z = {"hinge": kinds.mjJNT_HINGE, "slide": kinds.mjJNT_SLIDE}
        if kind in along_z:
            return [(name, along_z[kind], WAYS[2])]
        return {"ball": ball, "free": slides + ball, "fixed": []}[kind]

    def _body(self, parent: Any, name: str, fixed: TransformDescription | None) -> Any:
        place = {} if fixed is None else {"pos": fixed.translation, "quat": wxyz(fixed.rotation)}
        body = parent.add_body(name=name, **place)
        body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        return body

    def _unit(self, spec: Any, body: Any, unit: ImuDescription) -> None:
        mount, sensors = unit.mount, self.mujoco.mjtSensor
        body.add_site(name=unit.name, pos=mount.offset, quat=wxyz(mount.rotation))
        for kind in (sensors.mjSENS_GYRO, sensors.mjSENS_ACCELEROMETER, sensors.mjSENS_MAGNETOMETER):
            site = self.mujoco.mjtObj.mjOBJ_SITE
            spec.add_sensor(name=f"{unit.name} {kind.name}", type=kind, objtype=site, objname=unit.name)

    def readings(
        self, q: Floats, qd: Floats, qdd: Floats, base_acceleration: Floats, rocking: Floats | None = None
    ) -> Floats:
        """Gyro, accel and mag (n_units, 3, 3) at one instant, from coordinates and their rates (n_coordinates,).

        ``rocking`` (3, n_axes) holds the root's angles, their rates and accelerations.
        """
        mujoco, model, data = self.mujoco, self.model, self.data
        acceleration = np.zeros(model.nv)
        for k, name in enumerate(self.rocks if rocking is not None else ()):
            self._one(name, *rocking[:, [k]], acceleration)
        for frame in self.frames:
            columns, sign = self.columns[frame.joint], frame.sign
            self._impose(frame.name, sign * q[columns], sign * qd[columns], sign * qdd[columns], acceleration)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        data.qacc[:] = acceleration
        data.qacc[:3] = base_acceleration
        mujoco.mj_sensorPos(model, data)
        mujoco.mj_sensorVel(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_sensorAcc(model, data)
        return data.sensordata.copy().reshape(len(self.units), 3, 3)

    def _impose(self, frame: str, x: Floats, v: Floats, a: Floats, acceleration: Floats) -> None:
        if len(x) == 1:
            self._one(frame, x, v, a, acceleration)
            return
        for k, way in enumerate("xyz" if len(x) == 6 else ""):
            self._one(f"{frame} {way}", x[[k]], v[[k]], a[[k]], acceleration)
        turn = Rotation.from_rotvec(x[-3:]).as_quat(scalar_first=True)
        self._one(f"{frame} turn", turn, v[-3:], a[-3:], acceleration)

    def _one(self, name: str, x: Floats, v: Floats, a: Floats, acceleration: Floats) -> None:
        joint = self.data.joint(name)
        joint.qpos[:], joint.qvel[:] = x, v
        first = self.model.joint(name).dofadr[0]
        acceleration[first : first + len(a)] = a


def _columns(description: ModelDescription) -> dict[str, list[int]]:
    """Columns of each joint among the coordinates."""
    found, first = {}, 0
    for joint in description.joints:
        found[joint.name] = list(range(first, first + len(joint.coordinates)))
        first += len(joint.coordinates)
    return found


def field_ut(world: WorldDescription) -> Floats:
    """The magnetic field (3,), uT, in root axes, as CONVENTIONS.md has it."""
    up, forward = np.asarray(world.up), np.asarray(world.forward)
    azimuth, dip = world.magnetic_azimuth_rad, world.magnetic_dip_rad
    level = np.cos(azimuth) * forward + np.sin(azimuth) * np.cross(up, forward)
    return np.asarray(world.magnetic_norm_ut * (np.cos(dip) * level - np.sin(dip) * up))


def wxyz(rotation: Any) -> Floats:
    """Unit quaternion of a rotation matrix."""
    return Rotation.from_matrix(np.asarray(rotation)).as_quat(scalar_first=True)


def recorded(recording: oarlock.Recording, units: list[str]) -> Floats:
    """Gyro, accel and mag (T, n_units, 3, 3) of a recording; zeros where a unit has no magnetometer."""
    streams = [recording[unit] for unit in units]
    nothing = np.zeros((len(streams[0]), 3))
    quantities = ("gyro_rad_s", "accel_m_s2", "mag_ut")
    return np.stack(
        [np.stack([s.values.get(k, nothing) for k in quantities], axis=1) for s in streams], axis=1
    )
