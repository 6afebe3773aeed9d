"""Which rests of a session may be a still pose: those in which gravity has turned as the plan says. Used by `timing`.

The angle between the vertical in two postures is the same in a sensor as in its link, however the unit is mounted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.plan import SessionStep
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.model.rotation import angle_between

if TYPE_CHECKING:
    from oarlock.storage.arrays import Floats

LEAST_APART_RAD = float(np.radians(40.0))
"""Half of what hanging and level arms differ by: postures of people are never that far off."""
LEAST_ROWS = 4

Rest = tuple[SessionStep, Span]


def of_another_posture(
    step: SessionStep,
    span_s: Span,
    known: Sequence[Rest],
    body: BodyKinematics,
    units: Mapping[str, UnitRows],
) -> bool:
    """Whether a rest is not in the posture of a step.

    Args:
        step: with the posture.
        span_s: the rest, s.
        known: rests in postures that are known, such as those before the movements that were found.
        body: links of the units.
        units: readings.

    Returns:
        True where a unit is off by 40 degrees or more against half of the known rests; False without any.
    """
    offs = [_off_rad(step, span_s, other, body, units) for other in known]
    return bool(offs) and float(np.median(offs)) > LEAST_APART_RAD


def _off_rad(
    step: SessionStep, span_s: Span, other: Rest, body: BodyKinematics, units: Mapping[str, UnitRows]
) -> float:
    """By how much the vertical turned in the units more or less than in their links, rad; of the worst unit."""
    q, q_other = body.posture(step.pose), body.posture(other[0].pose)
    offs = [0.0]
    for name, unit in units.items():
        here, there = _up(unit, span_s), _up(unit, other[1])
        if here is not None and there is not None:
            planned = angle_between(*(body.root_from_link(name, p).T @ body.up for p in (q, q_other)))
            offs.append(abs(angle_between(here, there) - planned))
    return max(offs)


def _up(unit: UnitRows, span_s: Span) -> Floats | None:
    force = unit.accel[unit.rows(span_s)]
    return np.asarray(force.mean(axis=0)) if len(force) >= LEAST_ROWS else None
