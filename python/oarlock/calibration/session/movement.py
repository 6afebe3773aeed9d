"""Session search: rotation axis of a unit relative to the previous unit during a movement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Floats

BLOCK_S = 0.1
FLOOR_RAD = float(np.radians(1.0))
"""Axes inside a sensor, what the other joints do meanwhile, and joints that are no hinges to the last degree."""
PARTS = 8
CLEAR_TURN_RAD = 0.25
MOST_GAP_S = 0.1


@dataclass(frozen=True, eq=False)
class Turning:
    """A movement about one axis.

    Args:
        axis: (3,) unit axis in the child's sensor axes; positive as the plan's first turn says.
        std_rad: how well it is known, rad, each direction.
        purity: share of the turning that was about the axis, 0 to 1.
        swept_rad: from the one end of the movement to the other.
        clear: whether a first turn was clear enough to tell the sign.
    """

    axis: Floats
    std_rad: float
    purity: float
    swept_rad: float
    clear: bool


def turning(
    child: UnitRows,
    parent: UnitRows | None,
    span_s: Span,
    root_from_child: Floats,
    root_from_parent: Floats,
    first: int,
) -> Turning | None:
    """The axis of the relative angular velocity, in the child's axes.

    Nothing is said of the axis in the parent: while that one rests, its gyroscope knows nothing of it, and what the
    child's attitude says in its place only repeats the parent's own.

    Args:
        child: with its bias taken off.
        parent: the same; None is a body at rest, or one that is taken for one.
        span_s: the movement, s.
        root_from_child: (3, 3) attitude of the child's sensor when it begins.
        root_from_parent: (3, 3) the same of the parent's sensor.
        first: 1 or -1, the first clear turn's sign.

    Returns:
        None where a gyroscope is silent for 0.1 s, or nothing moved.
    """
    rows = child.rows(span_s)
    time_s, own = child.time_s[rows], child.gyro[rows]
    if len(time_s) < 20 or np.diff(time_s).max() > MOST_GAP_S:
        return None
    at_child = _attitudes(time_s, own, root_from_child)
    if parent is None:
        at_parent, other = np.broadcast_to(np.eye(3), at_child.shape), np.zeros_like(own)
    else:
        nearby = parent.time_s[parent.rows(span_s)]
        if len(nearby) < 20 or np.diff(nearby).max() > MOST_GAP_S:
            return None
        other = np.stack([np.interp(time_s, parent.time_s, g) for g in parent.gyro.T], axis=1)
        at_parent = _attitudes(time_s, other, root_from_parent)
    relative = np.einsum("tij,tj->ti", at_child, own) - np.einsum("tij,tj->ti", at_parent, other)
    in_child = np.einsum("tji,tj->ti", at_child, relative)
    block = np.floor((time_s - time_s[0]) / BLOCK_S).astype(int)
    edges = np.flatnonzero(np.diff(block, prepend=-1))
    counts = np.diff(np.append(edges, len(time_s)))[:, None]
    blocks = np.add.reduceat(in_child, edges, axis=0) / counts
    if not (blocks**2).sum() > 0.0:
        return None
    axis, std_rad, purity = _principal(blocks)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time_s) * _pairs(in_child @ axis))])
    clear = np.flatnonzero(np.abs(angle) > CLEAR_TURN_RAD)
    if len(clear) and np.sign(angle[clear[0]]) != first:
        axis = -axis
    return Turning(axis, std_rad, purity, float(np.ptp(angle)), bool(len(clear)))


def _pairs(values: Floats) -> Floats:
    return np.asarray(values[1:] + values[:-1])


def _attitudes(time_s: Floats, gyro: Floats, start: Floats) -> Floats:
    """(T, 3, 3) by integrating (T, 3) angular velocity in the body's axes."""
    turns = matrix_from_quat(quat_from_rotvec(0.5 * _pairs(gyro) * np.diff(time_s)[:, None]))
    found = np.empty((len(time_s), 3, 3))
    found[0] = start
    for k, turn in enumerate(turns):
        found[k + 1] = found[k] @ turn
    return found


def _principal(rates: Floats) -> tuple[Floats, float, float]:
    """Principal direction, its std by leaving out each of eight parts, and the share of energy about it."""
    axis, share = _direction(rates)
    parts = [p for p in np.array_split(np.arange(len(rates)), PARTS) if len(p)]
    squares = 0.0
    for part in parts:
        energy = (rates[part] ** 2).sum() / (rates**2).sum()
        if energy > 0.9:
            continue
        other, _ = _direction(np.delete(rates, part, axis=0))
        squares += 1.0 - min(1.0, float(axis @ other) ** 2)
    jackknife = np.sqrt((len(parts) - 1) / len(parts) * squares / 2.0)
    return axis, float(np.hypot(jackknife, FLOOR_RAD)), share


def _direction(rates: Floats) -> tuple[Floats, float]:
    values, vectors = np.linalg.eigh(rates.T @ rates)
    return np.asarray(vectors[:, 2]), float(values[2] / max(values.sum(), 1e-12))
