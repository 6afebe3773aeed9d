"""The rules by which estimates are scored. Each gives errors over the reference's samples, NaN where there is
none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.evaluation.reference import Reference
from oarlock.storage.arrays import Bools, Floats

from .estimate import OrientationEstimate
from .rotations import about_vertical, at, rotation, twist_rad, wrapped

Pair = tuple[str, str]
HEADED = "heading set by the reference"


def relative(quats: Mapping[str, Floats], time_s: Floats, pair: Pair, at_s: Floats) -> tuple[Rotation, Bools]:
    """first_from_second at the wanted times, and where both are there."""
    (first, good1), (second, good2) = (at(time_s, quats[body], at_s) for body in pair)
    return first.inv() * second, good1 & good2


def relative_error_rad(estimate: OrientationEstimate, reference: Reference, pair: Pair) -> Floats:
    """Angle between estimated and true relative orientation of two bodies, (T,), 0 to pi."""
    return np.asarray(np.linalg.norm(relative_error_parts_rad(estimate, reference, pair), axis=1))


def relative_error_parts_rad(estimate: OrientationEstimate, reference: Reference, pair: Pair) -> Floats:
    """The rotation vector from the estimated to the true relative orientation, (T, 3), in the second body's axes."""
    estimated, true, both = _both(estimate, reference, pair)
    return np.where(both[:, None], (estimated.inv() * true).as_rotvec(), np.nan)


def hinge_error_rad(estimate: OrientationEstimate, reference: Reference, pair: Pair, axis: str) -> Floats:
    """Difference of the hinge angles, (T,): of the twists of both relative orientations about the hinge's axis."""
    estimated, true, both = _both(estimate, reference, pair)
    return np.where(both, wrapped(twist_rad(estimated, axis) - twist_rad(true, axis)), np.nan)


def _both(
    estimate: OrientationEstimate, reference: Reference, pair: Pair
) -> tuple[Rotation, Rotation, Bools]:
    estimated, good = relative(estimate.quats, estimate.time_s, pair, reference.time_s)
    true, valid = relative(reference.quat_wxyz, reference.time_s, pair, reference.time_s)
    return estimated, true, good & valid


def turn_between_rad(reference: Reference, pair: Pair) -> Floats:
    """Angle of the true relative orientation of two bodies, (T,), 0 to pi; NaN in gaps."""
    turn, there = relative(reference.quat_wxyz, reference.time_s, pair, reference.time_s)
    return np.where(there, turn.magnitude(), np.nan)


def attitude_error_rad(
    estimate: OrientationEstimate, reference: Reference, body: str
) -> tuple[Floats, Floats, Floats]:
    """Inclination, heading and total error of one body, each (T,), once the mean heading difference is taken away.

    The difference world_from_body of the estimate times body_from_world of the reference is split into a turn
    about the vertical (heading) and the rest (inclination), as the authors of BROAD do; they compare headings as
    they are, here the circular mean over the scored samples is removed, so that software without magnetometer can
    be compared.
    """
    difference, good = world_error(estimate, reference, body)
    scored = good & reference.scored
    offset = circular_mean_rad(twist_rad(difference, "z")[scored])
    rest = about_vertical(-offset) * difference
    quat = rest.as_quat()
    inclination = 2.0 * np.arccos(np.clip(np.hypot(quat[:, 2], quat[:, 3]), 0.0, 1.0))
    parts = (inclination, twist_rad(rest, "z"), rest.magnitude())
    return tuple(np.where(good, part, np.nan) for part in parts)  # type: ignore[return-value]


def world_error(estimate: OrientationEstimate, reference: Reference, body: str) -> tuple[Rotation, Bools]:
    """Estimate times the inverse of the reference, in world axes, and where both are there."""
    estimated, good = at(estimate.time_s, estimate.quats[body], reference.time_s)
    true, valid = at(reference.time_s, reference.quat_wxyz[body], reference.time_s)
    return estimated * true.inv(), good & valid


def heading_zeroed(
    estimate: OrientationEstimate, reference: Reference, at_s: float, leader: str | None = None
) -> OrientationEstimate:
    """The estimate turned about the vertical by a constant, so that headings agree at one moment.

    Args:
        estimate: what is turned.
        reference: where the headings come from.
        at_s: the moment.
        leader: the body after whose heading all are turned, for software that knows the headings of its bodies against
            each other; without it each body is turned by itself.

    Raises:
        ValueError: estimate or reference have no orientation there.
    """
    turns = {
        body: about_vertical(_heading_offset_rad(estimate, reference, leader or body, at_s))
        for body in estimate.quats
    }
    return estimate.headed(turns, f"{HEADED} at {at_s:g} s")


def _heading_offset_rad(estimate: OrientationEstimate, reference: Reference, body: str, at_s: float) -> float:
    moment = np.array([at_s])
    estimated, good = at(estimate.time_s, estimate.quats[body], moment)
    true, valid = at(reference.time_s, reference.quat_wxyz[body], moment)
    if not (good & valid).all():
        raise ValueError(f"{estimate.name}: no orientation of {body} at {at_s:g} s to take the heading from")
    return float(twist_rad(true * estimated.inv(), "z")[0])


def circular_mean_rad(angle_rad: Floats) -> float:
    """Mean direction of angles, -pi to pi; 0 if there is none."""
    return float(np.angle(np.exp(1j * angle_rad).mean())) if len(angle_rad) else 0.0


def rmse_deg(error_rad: Floats, rows: Bools) -> float:
    """Root of the mean square over the kept samples that are there, deg; NaN if there is none."""
    errors = _there(error_rad, rows)
    return float(np.degrees(np.sqrt(np.mean(errors**2)))) if len(errors) else float("nan")


def median_deg(error_rad: Floats, rows: Bools) -> float:
    """Median of the size over the kept samples that are there, deg; NaN if there is none."""
    errors = _there(error_rad, rows)
    return float(np.degrees(np.median(np.abs(errors)))) if len(errors) else float("nan")


def _there(error_rad: Floats, rows: Bools) -> Floats:
    return error_rad[rows & np.isfinite(error_rad)]


def later(reference: Reference, lag_s: float) -> Reference:
    """The reference on the recording's clock, if its stamps come late by `lag_s`."""
    return replace(reference, time_s=reference.time_s - lag_s)


def body_rotations(reference: Reference, body: str) -> tuple[Rotation, Bools]:
    """The reference of one body; the identity where it is missing."""
    there = reference.there(body)
    quats = np.where(there[:, None], reference.quat_wxyz[body], [1.0, 0.0, 0.0, 0.0])
    return rotation(quats), there
