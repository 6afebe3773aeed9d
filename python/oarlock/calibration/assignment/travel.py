"""How far each unit turns in each movement, and how far it sits from the joint. Used by `assign_by_movement`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.calibration.session.timing import segments_of
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.storage.arrays import Floats

LEAST_S = 1.0
LEAST_TURN_RAD = 1.0
"""A movement in which no unit turns this far is none."""
MOVED = 0.5
"""A unit takes part if it turns half as far as the one that turns most."""
REST_S = 0.5
SMOOTH_S = 0.1
LEAST_ROWS = 20


@dataclass(frozen=True, eq=False)
class MovementInterval:
    """Movement between two rests: (start, end) s, and unit -> the angle that it turned in total, rad."""

    span_s: Span
    travel_rad: Mapping[str, float]

    @property
    def shares(self) -> dict[str, float]:
        """Unit -> travel against that of the unit that turns most, 0 to 1."""
        most = max(self.travel_rad.values())
        return {name: travel / most for name, travel in self.travel_rad.items()}

    @property
    def moving(self) -> frozenset[str]:
        """The units that take part."""
        return frozenset(name for name, share in self.shares.items() if share > MOVED)


def stretches_of(units: Mapping[str, UnitRows], within_s: Span, wanted: int) -> list[MovementInterval]:
    """Stretches of movement between rests of all units.

    Neighbours in which the same units move are one movement with a pause, if there are more stretches than wanted.
    """
    spans = [
        (start, end)
        for kind, start, end in segments_of(units)
        if kind == "moving" and end - start >= LEAST_S and start >= within_s[0] and end <= within_s[1]
    ]
    found = [MovementInterval(span, {n: _travel_rad(u, span) for n, u in units.items()}) for span in spans]
    found = [one for one in found if max(one.travel_rad.values()) >= LEAST_TURN_RAD]
    while len(found) > wanted:
        same = [k for k, (one, other) in enumerate(pairwise(found)) if one.moving == other.moving]
        if not same:
            break
        found[same[0] : same[0] + 2] = [_joined(*found[same[0] : same[0] + 2])]
    return found


def _joined(one: MovementInterval, other: MovementInterval) -> MovementInterval:
    travel = {name: one.travel_rad[name] + other.travel_rad[name] for name in one.travel_rad}
    return MovementInterval((one.span_s[0], other.span_s[1]), travel)


def _travel_rad(unit: UnitRows, span_s: Span) -> float:
    """The length of the unit's way in rotations, less what it turns at rest."""
    rows, rest = unit.rows(span_s), unit.rows((span_s[0] - REST_S, span_s[0]))
    if len(unit.time_s[rows]) < 2:
        return 0.0
    bias = unit.gyro[rest].mean(axis=0) if len(unit.gyro[rest]) else np.zeros(3)
    rate = np.linalg.norm(unit.gyro[rows] - bias, axis=1)
    return float(np.trapezoid(rate, unit.time_s[rows])) + 1e-9


def levers_m(units: Mapping[str, UnitRows], names: Sequence[str], span_s: Span) -> dict[str, float]:
    """Unit -> its distance from the centre about which it turns, m; NaN if its readings have a gap."""
    return {name: _lever_m(units[name], span_s) for name in names}


def _lever_m(unit: UnitRows, span_s: Span) -> float:
    """The acceleration of a point at r from a centre at rest is (K(alpha) + K(w)^2) r, K being the cross product.

    The unit's mount is not needed: gravity in the sensor is that of the rest before, turned by the gyroscope. A
    constant in room axes takes up errors of bias and tilt.
    """
    rest, rows = unit.rows((span_s[0] - REST_S, span_s[0])), unit.rows(span_s)
    time_s = unit.time_s[rows]
    if len(unit.time_s[rest]) < 4 or len(time_s) < LEAST_ROWS:
        return float("nan")
    gyro = unit.gyro[rows] - unit.gyro[rest].mean(axis=0)
    step_s = np.diff(time_s)
    turns = Rotation.from_rotvec(0.5 * (gyro[1:] + gyro[:-1]) * step_s[:, None])
    start_from_sensor = np.empty((len(time_s), 3, 3))
    start_from_sensor[0] = np.eye(3)
    for k, turn in enumerate(turns.as_matrix()):
        start_from_sensor[k + 1] = start_from_sensor[k] @ turn
    sensor_from_start = np.swapaxes(start_from_sensor, 1, 2)
    moved = unit.accel[rows] - sensor_from_start @ unit.accel[rest].mean(axis=0)
    width = max(1, round(SMOOTH_S / float(np.median(step_s))))
    rate, moved = _smooth(gyro, width), _smooth(moved, width)
    spin = _cross(rate)
    columns = _cross(np.gradient(rate, time_s, axis=0)) + spin @ spin
    design = np.concatenate([columns, sensor_from_start], axis=2).reshape(-1, 6)
    solved = np.linalg.lstsq(design, moved.reshape(-1), rcond=None)[0]
    return float(np.linalg.norm(solved[:3]))


def _cross(vectors: Floats) -> Floats:
    """(T, 3, 3) matrices that multiply like the cross product with (T, 3) vectors."""
    return np.asarray(np.cross(np.eye(3), vectors[:, None]))


def _smooth(values: Floats, width: int) -> Floats:
    """Moving average over an odd number of rows."""
    kernel = np.ones(2 * (width // 2) + 1)
    counts = np.convolve(np.ones(len(values)), kernel, "same")[:, None]
    return np.stack([np.convolve(column, kernel, "same") for column in values.T], axis=1) / counts
