"""Forward kinematics and readings of a model of hinges and slides, in arrays over sigma points; NumPy or JAX.

It uses only the model's description, not the engine, and is written as a user of array libraries would write it: all
points at once, all frames of one depth at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from oarlock.model.description import FrameDescription, ModelDescription, TransformDescription, pose_of

# An array of NumPy or JAX; there is no common type.
Array = Any

_NEXT = np.array([1, 2, 0])


@dataclass(frozen=True, eq=False)
class Level:
    """The k frames of one depth; each has its parent in the previous level."""

    parents: list[int]
    coordinates: list[int]
    hinge: Array
    slide: Array
    before: tuple[Array, Array] | None
    after: tuple[Array, Array]


class PlainKinematics:
    """Predicted readings of a model's sensors.

    Args:
        described: `Model.describe()`; joints are hinges, slides or fixed, inertial units have all three quantities.
        states: names of the states.
        xp: `numpy` or `jax.numpy`.
    """

    def __init__(self, described: ModelDescription, states: Sequence[str], xp: Any = np) -> None:
        self.xp = xp
        self._place = {name: k for k, name in enumerate(states)}
        self._joints = [joint.name for joint in described.joints]
        kinds = {joint.kind for joint in described.joints}
        if not kinds <= {"hinge", "slide", "fixed"}:
            raise ValueError(f"joints of kinds {sorted(kinds)}; this is written for hinges and slides")
        self._spread()
        order = self._level_frames(described)
        self._see(described, order)
        self._surround(described)

    def measure(self, x: Array, inputs: Array) -> Array:
        """Readings (P, m) at states x (P, n); input joints read `inputs`, (n_coordinates,) or (P, n_coordinates)."""
        q, qd, qdd = (part @ x.T for part in self._parts)
        q = self._padded(q + inputs.T.reshape(len(self._joints), -1))
        frames = self._frames(q, self._padded(qd), self._padded(qdd), self._force(x.T))
        return self._readings(x.T, q, frames).T

    # --- preparation -------------------------------------------------------------------------------------

    def _spread(self) -> None:
        """Matrices from states to values, velocities and accelerations of the joints."""
        parts = np.zeros((3, len(self._place), len(self._joints)))
        for column, name in enumerate(self._joints):
            for part, state in enumerate((name, f"{name}.velocity", f"{name}.acceleration")):
                if state in self._place:
                    parts[part, self._place[state], column] = 1.0
        self._parts = [self.xp.asarray(part.T) for part in parts]

    def _level_frames(self, described: ModelDescription) -> dict[str, int]:
        """Sorts frames by depth; returns the position of each in the concatenated levels."""
        frames = described.frames
        kinds = {joint.name: joint.kind for joint in described.joints}
        depth = {frames[0].name: 0}
        levels: list[list[FrameDescription]] = [[frames[0]]]
        for frame in frames[1:]:
            depth[frame.name] = deep = depth[frame.parent or ""] + 1
            if deep == len(levels):
                levels.append([])
            levels[deep].append(frame)
        self._levels = [self._level(levels[k - 1], levels[k], kinds) for k in range(1, len(levels))]
        names = [frame.name for level in levels for frame in level]
        return {name: k for k, name in enumerate(names)}

    def _level(
        self, above: list[FrameDescription], frames: list[FrameDescription], kinds: Mapping[str, str]
    ) -> Level:
        parents = [frame.name for frame in above]
        # frames without a joint use an additional column of zeros
        columns = [self._joints.index(f.joint) if f.joint else len(self._joints) for f in frames]
        signs = {
            kind: [f.sign * (kinds.get(f.joint or "") == kind) for f in frames] for kind in ("hinge", "slide")
        }
        before = [f.before for f in frames]
        return Level(
            [parents.index(f.parent or "") for f in frames],
            columns,
            self.xp.asarray(signs["hinge"], dtype=float)[:, None, None, None],
            self.xp.asarray(signs["slide"], dtype=float)[:, None, None, None]
            if any(signs["slide"])
            else None,
            self._fixed(before) if any(before) else None,
            self._fixed([f.after for f in frames]),
        )

    def _fixed(self, transforms: Sequence[TransformDescription | None]) -> tuple[Array, Array]:
        poses = np.array([pose_of(transform) for transform in transforms])
        rotation, translation = (np.ascontiguousarray(part) for part in (poses[:, :3, :3], poses[:, :3, 3]))
        return self.xp.asarray(rotation)[..., None], self.xp.asarray(translation)[..., None, None]

    def _see(self, described: ModelDescription, order: Mapping[str, int]) -> None:
        """Frames, arms and rows of sensors and closures."""
        units = described.inertial_units
        inputs = {joint.name for joint in described.inputs}
        encoders = [s for s in described.encoders if s.joint not in inputs]
        loops = described.closures
        self._units = [order[s.frame] for s in units]
        self._mounts = self.xp.asarray([s.mount.rotation for s in units])[..., None]
        self._arms = self.xp.asarray([s.mount.offset for s in units])[..., None, None]
        self._encoders = [self._joints.index(s.joint) for s in encoders]
        self._ends = [order[frame] for frame in (*(c.frame_a for c in loops), *(c.frame_b for c in loops))]
        points = [*(c.point_a for c in loops), *(c.point_b for c in loops)]
        no_axis = (np.nan, np.nan, np.nan)
        axes = [*(c.axis_a or no_axis for c in loops), *(c.axis_b or no_axis for c in loops)]
        self._grips = self.xp.asarray(np.stack([points, axes], axis=-1))[..., None]
        rows = [
            f"{s.name}.{part}_{axis}" for part in ("gyro", "accel", "mag") for s in units for axis in "xyz"
        ]
        rows += [s.name for s in encoders]
        rows += [f"{c.name}.{part}{axis}" for part in ("", "axis_") for c in loops for axis in "xyz"]
        names = described.measurement_names
        if sorted(rows) != sorted(names):
            raise ValueError(
                "this is written for whole inertial units, encoders and closures of points and axes"
            )
        self._order = [rows.index(name) for name in names]
        bias = np.zeros((len(self._place), len(names)))
        for row, name in enumerate(names):
            state = name.replace(".gyro_", ".gyro_bias_").replace(".accel_", ".accel_bias_")
            if state != name and state in self._place:
                bias[self._place[state], row] = 1.0
        self._bias = self.xp.asarray(bias) if bias.any() else None

    def _surround(self, described: ModelDescription) -> None:
        world, n = described.world, len(self._place)
        up, forward = np.asarray(world.up), np.asarray(world.forward)
        norm, dip = world.magnetic_norm_ut, world.magnetic_dip_rad
        self._lift = self.xp.asarray(up * world.gravity_m_s2)
        self._field = [
            self.xp.asarray(norm * v)
            for v in (forward * np.cos(dip), np.cross(up, forward) * np.cos(dip), -up * np.sin(dip))
        ]
        self._azimuth_rad = float(world.magnetic_azimuth_rad)
        pushes = np.zeros((n, 3))
        for base in described.base_acceleration:
            if base.name in self._place:
                pushes[self._place[base.name]] = base.axis
        self._pushes = self.xp.asarray(pushes) if pushes.any() else None

    # --- at every step: vectors (frames, 3, 1, P), matrices (frames, 3, 3, P), points side by side in memory ---

    def _padded(self, values: Array) -> Array:
        return self.xp.concatenate([values, self.xp.zeros_like(values[:1])])

    def _force(self, x: Array) -> Array:
        """Acceleration of the root minus gravity."""
        force = self._lift[:, None] + self.xp.zeros_like(x[:1])
        if self._pushes is not None:
            force = force + self._pushes.T @ x
        return force[None, :, None]

    def _frames(
        self, q: Array, qd: Array, qdd: Array, force: Array
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Orientation, position, angular velocity and acceleration, and specific force of all frames, in root axes."""
        xp = self.xp
        zero = xp.zeros_like(force)
        levels = [(xp.eye(3)[None, :, :, None] + zero, zero, zero, zero, force)]
        for level in self._levels:
            rotation, place, spin, rate, push = (a[xp.asarray(level.parents)] for a in levels[-1])
            if level.before is not None:
                arm = self._times(rotation, level.before[1])
                rotation = self._times(rotation, level.before[0])
                place, push = place + arm, push + self._swung(spin, rate, arm)
            moves = tuple(v[xp.asarray(level.coordinates)][:, None, None] for v in (q, qd, qdd))
            axis = rotation[:, :, 2:3]
            if level.slide is not None:
                shift, speed, gain = (axis * (v * level.slide) for v in moves)
                push = push + self._swung(spin, rate, shift) + 2.0 * self._cross(spin, speed) + gain
                place = place + shift
            angle, speed, gain = (v * level.hinge for v in moves)
            angular_rate = axis * speed
            rate = rate + axis * gain + self._cross(spin, angular_rate)
            spin = spin + angular_rate
            first, second = rotation[:, :, 0:1], rotation[:, :, 1:2]
            cos, sin = xp.cos(angle), xp.sin(angle)
            rotation = xp.concatenate([first * cos + second * sin, second * cos - first * sin, axis], axis=2)
            arm = self._times(rotation, level.after[1])
            rotation = self._times(rotation, level.after[0])
            levels.append((rotation, place + arm, spin, rate, push + self._swung(spin, rate, arm)))
        rotation, place, spin, rate, push = (xp.concatenate(parts) for parts in zip(*levels, strict=True))
        return rotation, place, spin, rate, push

    def _times(self, a: Array, b: Array) -> Array:
        """Matrix products, written so that compilers fuse them with the following operations."""
        terms = (a[:, :, k : k + 1] * b[:, k : k + 1] for k in range(3))
        return sum(terms, start=next(terms))

    def _cross(self, a: Array, b: Array) -> Array:
        return (a * b[:, _NEXT] - a[:, _NEXT] * b)[:, _NEXT]

    def _swung(self, spin: Array, rate: Array, arm: Array) -> Array:
        return self._cross(rate, arm) + self._cross(spin, self._cross(spin, arm))

    def _readings(self, x: Array, q: Array, frames: tuple[Array, Array, Array, Array, Array]) -> Array:
        xp, count = self.xp, x.shape[1]
        rotation, spin, rate, push = (frames[k][xp.asarray(self._units)] for k in (0, 2, 3, 4))
        specific_force = push + self._swung(spin, rate, self._times(rotation, self._arms))
        sensor_from_root = xp.swapaxes(self._times(rotation, self._mounts), 1, 2)
        azimuth = x[self._place["azimuth"]] if "azimuth" in self._place else self._azimuth_rad + 0.0 * x[0]
        along, across, down = (v[:, None] for v in self._field)
        field = xp.cos(azimuth) * along + xp.sin(azimuth) * across + down
        parts = [self._times(sensor_from_root, v) for v in (spin, specific_force, field[None, :, None])]
        rows = [part.reshape(-1, count) for part in parts]
        rows.append(q[xp.asarray(self._encoders)])
        turn, place = (frames[k][xp.asarray(self._ends)] for k in (0, 1))
        grips = self._times(turn, self._grips)
        points, axes = place[:, :, 0] + grips[:, :, 0], grips[:, :, 1]
        half = len(self._ends) // 2
        rows += [(v[:half] - v[half:]).reshape(-1, count) for v in (points, axes)]
        readings = xp.concatenate(rows)[xp.asarray(self._order)]
        return readings if self._bias is None else readings + self._bias.T @ x
