"""`assign_by_movement`: which unit sits where, from movements in a known order, whatever the units are called.

Units of a limb turn together, which gives the limb and the side. Among units that turn together, the one that sits
further from the joint accelerates more, which gives the place on the limb.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from oarlock.calibration.assignment.movements import (
    NamedMovement,
    helpful_movements,
    in_order,
    parsed_order,
    turning_sensors,
)
from oarlock.calibration.assignment.travel import MovementInterval, levers_m, stretches_of
from oarlock.calibration.session.unit_rows import UnitRows
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

LEAST_MARGIN = 0.25
"""Exchanging two units must make the movements fit worse by at least this share of a full movement, squared."""
LEAST_LEVER_RATIO, LEAST_LEVER_GAP_M = 1.1, 0.03

Levers = Mapping[str, float]


@dataclass(frozen=True)
class MovementAssignment:
    """Which unit sits where, and the numbers that say so.

    Args:
        units: sensor -> stream.
        movements: (name, start s, end s) of each movement, in order of time.
        shares: stream -> how far it turned in each movement, against the unit that turned most.
        levers_m: stream -> distance from the joint of the movement that told it from its neighbours, m.
    """

    units: Mapping[str, str]
    movements: tuple[tuple[str, float, float], ...]
    shares: Mapping[str, tuple[float, ...]]
    levers_m: Mapping[str, float]


def assign_by_movement(
    model: Model,
    recording: Recording,
    order: str,
    start_s: float = -np.inf,
    end_s: float = np.inf,
) -> MovementAssignment:
    """Find which unit sits where from movements in a known order.

    The person rests for two seconds, makes the first movement three or four times without a pause, rests, makes the
    next. `MOVEMENTS` in `oarlock.calibration.assignment.movements` has their names.

    Args:
        model: the body with the sensors that are worn, such as `Model.with_units` gives.
        recording: inertial units of any names.
        order: names of the movements in order of time, such as "right_arm,left_arm,nod".
        start_s: movements before it are ignored, s.
        end_s: movements after it are ignored, s.

    Raises:
        DataError: the movements cannot tell all sensors apart, the numbers of units or movements differ, or the
            readings are ambiguous; with the numbers.
    """
    movements = parsed_order(order)
    sensors = [sensor.name for sensor in model.describe().inertial_units]
    groups = _groups(model, sensors, movements)
    units = _units(recording, sensors)
    found = stretches_of(units, (start_s, end_s), len(movements))
    if len(found) != len(movements):
        raise DataError(_other_number(found, movements))
    shares = {name: tuple(one.shares[name] for one in found) for name in units}
    limbs = _limbs(list(units), sensors, movements, shares)
    assigned: dict[str, str] = {}
    levers: dict[str, float] = {}
    for group in groups:
        names = [unit for unit, sensor in limbs.items() if sensor in group]
        if len(group) > 1:
            own = _own_stretch(group, movements, found)
            levers |= levers_m(units, names, own.span_s)
            names = _by_lever(names, levers, group)
        assigned |= dict(zip(group, names, strict=True))
    spans = tuple((m.name, *one.span_s) for m, one in zip(movements, found, strict=True))
    return MovementAssignment({s: assigned[s] for s in sensors}, spans, shares, levers)


def _units(recording: Recording, sensors: Sequence[str]) -> dict[str, UnitRows]:
    streams = [
        s
        for s in recording.streams
        if isinstance(s, ImuStream) and s.gyro_rad_s is not None and s.accel_m_s2 is not None
    ]
    if len(streams) != len(sensors):
        there = ", ".join(stream.name for stream in streams)
        raise DataError(
            f"assign: {len(streams)} units with gyroscope and accelerometer ({there}), but the body has "
            f"{len(sensors)} sensors ({', '.join(sensors)}). Name those that are worn: --units "
            f"{','.join(sensors[: len(streams)])}"
        )
    return {stream.name: UnitRows.of(stream) for stream in streams}


def _expected(
    sensors: Sequence[str], movements: Sequence[NamedMovement]
) -> dict[str, tuple[float | None, ...]]:
    """Sensor -> what is expected of it in each movement; see `turning_sensors`."""
    each = [turning_sensors(movement, sensors) for movement in movements]
    return {sensor: tuple(one[sensor] for one in each) for sensor in sensors}


def _groups(model: Model, sensors: Sequence[str], movements: Sequence[NamedMovement]) -> list[list[str]]:
    """Sensors that turn in the same movements, from the root outward.

    Raises:
        DataError: sensors of a group do not turn in any movement, or are not on one limb.
    """
    by_kind: dict[tuple[float | None, ...], list[str]] = {}
    for sensor, kind in _expected(sensors, movements).items():
        by_kind.setdefault(kind, []).append(sensor)
    groups = []
    for kind, group in by_kind.items():
        ordered = in_order(model, group)
        if len(group) > 1 and (ordered is None or 1.0 not in kind):
            helpful = helpful_movements(group, movements)
            raise DataError(
                f"assign: the movements {', '.join(m.name for m in movements)} do not tell {', '.join(group)} apart. "
                f"Add {' or '.join(helpful) or 'names by hand'}"
            )
        groups.append(ordered or group)
    return groups


def _limbs(
    units: Sequence[str],
    sensors: Sequence[str],
    movements: Sequence[NamedMovement],
    shares: Mapping[str, tuple[float, ...]],
) -> dict[str, str]:
    """Unit -> a sensor of the group that it belongs to.

    Raises:
        DataError: two units of different groups could be exchanged.
    """
    expected = _expected(sensors, movements)
    costs = np.array([[_misfit(shares[unit], expected[sensor]) for sensor in sensors] for unit in units])
    rows, columns = linear_sum_assignment(costs)
    for (i, a), (j, b) in combinations(zip(rows, columns, strict=True), 2):
        if expected[sensors[a]] == expected[sensors[b]]:
            continue
        margin = costs[i, b] + costs[j, a] - costs[i, a] - costs[j, b]
        if margin < LEAST_MARGIN:
            raise DataError(_unclear(units[i], units[j], sensors[a], sensors[b], movements, shares))
    return {units[i]: sensors[a] for i, a in zip(rows, columns, strict=True)}


def _misfit(shares: Sequence[float], expected: Sequence[float | None]) -> float:
    return sum(
        (share - turns) ** 2 for share, turns in zip(shares, expected, strict=True) if turns is not None
    )


def _own_stretch(
    group: Sequence[str], movements: Sequence[NamedMovement], found: Sequence[MovementInterval]
) -> MovementInterval:
    """The movement of the fewest segments in which a group turns: its centre is the nearest joint."""
    own = [
        (len(movement.segments), k)
        for k, movement in enumerate(movements)
        if turning_sensors(movement, group)[group[0]] == 1.0
    ]
    return found[min(own)[1]]


def _by_lever(names: Sequence[str], levers: Levers, group: Sequence[str]) -> list[str]:
    """Units from the joint outward.

    Raises:
        DataError: two are equally far from it.
    """
    ordered = sorted(names, key=lambda name: levers[name])
    for near, far in pairwise(ordered):
        apart = levers[far] - levers[near] > LEAST_LEVER_GAP_M
        if not (apart and levers[far] > LEAST_LEVER_RATIO * levers[near]):
            numbers = ", ".join(f"{name} {100.0 * levers[name]:.0f} cm" for name in ordered)
            raise DataError(
                f"assign: {', '.join(names)} are {', '.join(group)}, but their order is unclear. Distances from the "
                f"joint: {numbers}. Move faster and keep the limb stiff, or add a movement of the next joint"
            )
    return ordered


def _unclear(
    one: str,
    other: str,
    sensor: str,
    other_sensor: str,
    movements: Sequence[NamedMovement],
    shares: Mapping[str, tuple[float, ...]],
) -> str:
    def numbers(unit: str) -> str:
        parts = [f"{m.name} {100 * s:.0f} %" for m, s in zip(movements, shares[unit], strict=True)]
        return f"{unit}: {', '.join(parts)}"

    return (
        f"assign: {one} and {other} could be {sensor} and {other_sensor} or the other way round. Share of the largest "
        f"turn in each movement: {numbers(one)}; {numbers(other)}. Move one limb at a time, and keep the others still"
    )


def _other_number(found: Sequence[MovementInterval], movements: Sequence[NamedMovement]) -> str:
    listed = [
        f"{one.span_s[0]:.1f} to {one.span_s[1]:.1f} s ({', '.join(sorted(one.moving))})" for one in found
    ]
    names = ", ".join(movement.name for movement in movements)
    return (
        f"assign: {len(movements)} movements were named ({names}), {len(found)} were found: "
        f"{'; '.join(listed) or 'none'}. Rest for two seconds between movements and pause nowhere else, "
        "or leave out what does not belong to them with --from and --to"
    )
