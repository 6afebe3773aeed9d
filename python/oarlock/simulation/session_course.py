"""Simulated movements of a person and of units on a table during a session, for `simulate_session`.

The calibration uses nothing of this module, and this module uses only the plan of the calibration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.calibration.session.plan import SessionPlan, SessionStep
from oarlock.model.description import ModelDescription
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model


KNOT_S = 0.05
HOLD_S, PAUSE_S, CHANGE_S = 4.0, 2.0, 1.5
SWINGS = 4
LEAST_ERROR = 0.05
"""Weight of small joint errors against those of segments: it only decides where two joints have nearly one axis."""
SWING_S = 1.0
MOST_SWING_RAD = 1.3
LEAST_SWING_RAD = 0.3
FACES = np.radians([[0, 0, 0], [90, 0, 0], [180, 0, 0], [270, 0, 0], [270, 90, 0], [270, 270, 0]])
LIE_S, FACE_S, TURN_S, TUMBLE_S = 10.0, 3.0, 0.8, 12.0


@dataclass(frozen=True, eq=False)
class SessionMotion:
    """Coordinates (K, n) at knots (K,) s, and the true interval of each step."""

    time_s: Floats
    q: Floats
    spans: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class PostureErrors:
    """Errors of the postures of a person.

    Args:
        model: the body.
        joint_rad: standard deviation of the error of each angle in each step, rad.
        segment_rad: the same of the attitude of each segment with a unit, about each axis, rad.
        sway_rad: slow motion during a step, rad; four times as large during a movement.
    """

    model: Model
    joint_rad: float
    segment_rad: float
    sway_rad: float

    def drawn(self, posture: Floats, turning: Floats, rng: np.random.Generator) -> Floats:
        """Errors (n,) of the coordinates of a posture."""
        errors = turning * rng.normal(0.0, self.joint_rad, len(posture))
        if not self.segment_rad:
            return np.asarray(errors)
        frames = [s.frame for s in self.model.describe().inertial_units]
        turns = self.model.frame_jacobian(posture, frames).by_coordinate[:, 3:] * turning
        wanted = rng.normal(0.0, self.segment_rad, (len(frames), 3))
        rows = np.vstack([turns.reshape(-1, len(posture)), LEAST_ERROR * np.eye(len(posture))])
        found = np.linalg.lstsq(rows, np.r_[wanted.ravel(), np.zeros(len(posture))])[0]
        return np.asarray(errors + turning * found)


class _Score:
    """Waypoints, connected by minimum-jerk movements (Flash and Hogan 1985)."""

    def __init__(self, q: Floats) -> None:
        self.parts: list[Floats] = [q[None]]

    @property
    def now_s(self) -> float:
        return (sum(len(p) for p in self.parts) - 1) * KNOT_S

    @property
    def q(self) -> Floats:
        return np.asarray(self.parts[-1][-1])

    def hold(self, seconds: float) -> None:
        self.parts.append(np.repeat(self.q[None], round(seconds / KNOT_S), axis=0))

    def go(self, q: Floats, seconds: float) -> None:
        share = smooth_step(np.arange(1, round(seconds / KNOT_S) + 1) / round(seconds / KNOT_S))
        self.parts.append(self.q + share[:, None] * (q - self.q))


def smooth_step(share: Floats) -> Floats:
    """A minimum-jerk transition from 0 to 1, at rest at both ends."""
    return np.asarray(share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def body_course(
    errors: PostureErrors, plan: SessionPlan, rest: Mapping[str, float], rng: np.random.Generator
) -> SessionMotion:
    """Movement of the body through all steps of a plan except those on the table.

    Args:
        errors: the body and its errors.
        plan: the steps; times are ignored.
        rest: coordinate -> rest posture.
        rng: random generator of both.
    """
    description, names = errors.model.describe(), list(rest)
    turning = np.array([_turns(description, n) for n in names])
    score = _Score(np.array(list(rest.values())))
    spans, moving = {}, []
    for step in plan.steps:
        if step.kind not in ("still", "pose", "move"):
            continue
        posture = np.array([step.pose.get(n, rest[n]) for n in names])
        posture = posture + errors.drawn(posture, turning, rng)
        score.go(posture, CHANGE_S)
        start = score.now_s
        score.hold(HOLD_S if step.kind != "move" else PAUSE_S)
        if step.kind == "move":
            begun = score.now_s
            for waypoint in _swings(description, step, names, posture):
                score.go(waypoint, SWING_S)
            moving.append((begun, score.now_s))
            spans[step.name] = (begun, score.now_s)
            score.hold(PAUSE_S)
        else:
            spans[step.name] = (start, score.now_s)
    q = np.concatenate(score.parts)
    time_s = np.asarray(KNOT_S * np.arange(len(q)), dtype=np.float64)
    busy = 1.0 + 3.0 * _among(time_s, moving)
    own = {c for s in plan.steps for j in s.joints for c in _coordinates(description, j)}
    sways = turning * errors.sway_rad * busy[:, None] * _wander(len(q), len(names), rng)
    sways[:, [k for k, n in enumerate(names) if n in own]] *= 0.5
    return SessionMotion(time_s, np.asarray(q + sways, dtype=np.float64), spans)


def _turns(description: ModelDescription, coordinate: str) -> bool:
    joint = next(j for j in description.joints if coordinate in j.coordinates)
    return joint.kind != "slide" and not joint.input and not coordinate.endswith((".x", ".y", ".z"))


def _coordinates(description: ModelDescription, joint: str) -> list[str]:
    own = next(j for j in description.joints if j.name == joint)
    return [c for c in own.coordinates if not c.endswith((".x", ".y", ".z"))]


def _swings(
    description: ModelDescription, step: SessionStep, names: Sequence[str], posture: Floats
) -> list[Floats]:
    """Waypoints: four times to the first side and to the other, as far as the joint allows, and back."""
    waypoints = []
    for k in range(2 * SWINGS + 1):
        q = posture.copy()
        for joint in step.joints:
            own = next(j for j in description.joints if j.name == joint)
            columns = [names.index(c) for c in _coordinates(description, joint)]
            if len(columns) == 1:
                low, high = own.limits
                room = {1: high - q[columns[0]], -1: q[columns[0]] - low}
                side = step.first if k % 2 == 0 else -step.first
                far = min(MOST_SWING_RAD, room[side] - 0.1)
                if k < 2 * SWINGS and far > LEAST_SWING_RAD:
                    q[columns[0]] += side * far
            elif k < 2 * SWINGS and step.axis is not None:
                about = np.asarray(step.axis) / np.linalg.norm(step.axis)
                turn = Rotation.from_rotvec((step.first if k % 2 == 0 else -0.5 * step.first) * 0.8 * about)
                q[columns] = (turn * Rotation.from_rotvec(q[columns])).as_rotvec()
        waypoints.append(q)
    return waypoints


def _among(time_s: Floats, spans: Sequence[tuple[float, float]]) -> Floats:
    """1 inside the spans, 0 outside, with smooth flanks of half a second inside."""
    inside = np.zeros_like(time_s)
    for start, end in spans:
        flank = np.clip(np.minimum(time_s - start, end - time_s) / 0.5, 0.0, 1.0)
        inside = np.maximum(inside, smooth_step(flank))
    return inside


def _wander(count: int, columns: int, rng: np.random.Generator) -> Floats:
    """Slow random courses (count, columns) with an rms of 1: sums of sines from 0.05 to 0.4 Hz."""
    time_s = KNOT_S * np.arange(count)
    rates = 2.0 * np.pi * rng.uniform(0.05, 0.4, (6, columns))
    phases = rng.uniform(0.0, 2.0 * np.pi, (6, columns))
    return np.asarray(np.sin(time_s[:, None, None] * rates + phases).sum(axis=1) / np.sqrt(3.0))


def table_course(rate_hz: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Times (T,) s and attitudes (T, 3, 3), room from sensor, of a unit on a table, then turned by hand."""
    tilt = Rotation.from_rotvec(rng.normal(0.0, 0.05, 3)) * Rotation.from_rotvec([0, 0, rng.uniform(-3, 3)])
    faces = [tilt * Rotation.from_euler("xyz", face) for face in FACES]
    parts: list[Rotation] = [faces[0]] * round(LIE_S * rate_hz)
    for before, after in pairwise(faces):
        share = smooth_step(np.arange(1, round(TURN_S * rate_hz) + 1) / round(TURN_S * rate_hz))
        step = (before.inv() * after).as_rotvec()
        parts += [before * Rotation.from_rotvec(s * step) for s in share]
        parts += [after] * round(FACE_S * rate_hz)
    count = round(TUMBLE_S * rate_hz)
    time_s = np.arange(count) / rate_hz
    phases, fast = rng.uniform(0.0, 2.0 * np.pi, 3), np.array([0.9, 1.3, 1.7])
    rates = 1.6 * smooth_step(np.clip(time_s, 0.0, 1.0))[:, None] * np.sin(time_s[:, None] * fast + phases)
    now = parts[-1]
    for rate in rates:
        now = now * Rotation.from_rotvec(rate / rate_hz)
        parts.append(now)
    return np.arange(len(parts)) / rate_hz, np.stack([p.as_matrix() for p in parts])
