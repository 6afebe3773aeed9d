"""Named angles of a rotation (intrinsic sequences such as "YXY") for tracks, exports and reports.

A sequence such as "ZXY" is intrinsic: R = Rz(a) Rx(b) Ry(c). The International Society of Biomechanics names its joint
angles so (Wu et al. 2005, J. Biomech. 38, 981-992): the shoulder by YXY, elbow and wrist by ZXY. In two poses of every
sequence the first and the last turn share their axis, and only their sum or difference is known: the poles of the
middle angle, 0 and 180 deg where the first letter comes back, else -90 and 90 deg.
"""

from __future__ import annotations

import itertools

import numpy as np

from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec, quat_product, wrap
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

DEFAULT_SEQUENCE = "ZXY"
NEAR_SINGULAR_RAD = np.radians(15.0)
"""Within this of a pole, errors of first and last angle are at least four times those of the rotation."""

SEQUENCES = tuple(
    "".join(letters) for letters in itertools.product("XYZ", repeat=3) if letters[1] not in letters[::2]
)


def checked_sequence(sequence: str, where: str) -> str:
    """The sequence itself if it is one.

    Raises:
        DataError: it is not one of the twelve.
    """
    if sequence not in SEQUENCES:
        raise DataError(
            f"{where}: {sequence!r} is no angle sequence; expected three of the letters X, Y, Z, neighbours "
            f"different: {', '.join(SEQUENCES)}"
        )
    return sequence


def angle_labels(sequence: str) -> tuple[str, str, str]:
    """Short names of the three angles: ("z", "x", "y"); ("y1", "x", "y2") where a letter comes back."""
    first, middle, last = (letter.lower() for letter in sequence)
    return (f"{first}1", middle, f"{last}2") if first == last else (first, middle, last)


def angles_from_quat(quat_wxyz: Floats, sequence: str) -> Floats:
    """Angles (T, 3), rad, continuous over time; NaN where the rotation (T, 4) is.

    Each rotation has two triples, (a, b, c) and one across a pole, and each angle any number of turns. The first
    rotation that is not near singular gets its triple in the usual range (first and last in (-180, 180] deg, the
    middle in [0, 180] deg where the first letter comes back, else in [-90, 90]); every other one the triple nearest to
    the last rotation before it that is not near singular. Near a pole it is the triple nearest to the straight line
    between the two sides. So an arm that swings through a pole gets angles without a jump. Full turns are removed from
    the whole course of an angle if its median is more than half a turn away from 0.
    """
    there = np.isfinite(quat_wxyz).all(axis=1)
    result = np.full((len(quat_wxyz), 3), np.nan)
    if there.any():
        result[there] = _near_zero(
            _as_named(_continuous(_proper_angles(quat_wxyz[there], sequence)), sequence)
        )
    return result


def near_singular(quat_wxyz: Floats, sequence: str) -> Bools:
    """Where the middle angle is within 15 deg of a pole, (T,)."""
    return _near_pole(_proper_angles(quat_wxyz, sequence))


def angles_near(quat_wxyz: Floats, sequence: str, wanted_rad: Floats) -> Floats:
    """Of the triples that mean the rotations (T, 4) those nearest to other ones (T, 3), rad."""
    wanted = _as_proper(wanted_rad, sequence)
    return _as_named(_nearest(_proper_angles(quat_wxyz, sequence), wanted), sequence)


def angle_stds(angles_rad: Floats, sequence: str, std_rad: Floats) -> Floats:
    """Standard deviations (T, 3) of angles (T, 3) from independent ones about the child's axes (T, 3), to first order.

    Towards a pole those of the first and the last angle grow without bound.
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(np.linalg.norm(angles_per_turn(angles_rad, sequence) * std_rad[:, None, :], axis=2))


def quat_from_angles(angles_rad: Floats, sequence: str) -> Floats:
    """The rotations (T, 4) of angles (T, 3), rad."""
    turns = [quat_from_rotvec(angles_rad[:, [k]] * _axis(letter)) for k, letter in enumerate(sequence)]
    return quat_product(quat_product(turns[0], turns[1]), turns[2])


def angles_per_turn(angles_rad: Floats, sequence: str) -> Floats:
    """How the angles (T, 3) grow with a small turn in the child's axes, (T, 3, 3); infinite at a pole."""
    last = matrix_from_quat(quat_from_rotvec(angles_rad[:, 2:] * _axis(sequence[2])))
    middle = matrix_from_quat(quat_from_rotvec(angles_rad[:, 1:2] * _axis(sequence[1])))
    third = np.broadcast_to(_axis(sequence[2]), (len(angles_rad), 3))
    second = np.einsum("tji,j->ti", last, _axis(sequence[1]))
    first = np.einsum("tji,tkj,k->ti", last, middle, _axis(sequence[0]))
    across = np.stack([np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=1)
    volume = np.sum(first * across[:, 0], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(across / volume[:, None, None])


def _axis(letter: str) -> Floats:
    return np.asarray(np.eye(3)["XYZ".index(letter)])


def _handedness(sequence: str) -> float:
    """1 where the first axis, the middle one and the one left over follow each other by the right hand, else -1."""
    i, j = ("XYZ".index(letter) for letter in sequence[:2])
    return 1.0 if (j - i) % 3 == 1 else -1.0


def _proper_angles(quat_wxyz: Floats, sequence: str) -> Floats:
    """Angles of the sequence that turns about the first axis twice, middle one in [0, pi]; (T, 3).

    A sequence of three letters becomes one of these by a quarter turn about the middle axis: Bernardes and Viollet
    2022, "Quaternion to Euler angles conversion: a direct, general and computationally efficient method", PLoS ONE
    17(11). At a pole first and last angle share their sum evenly.
    """
    q = quat_wxyz
    i, j = ("XYZ".index(letter) for letter in sequence[:2])
    if sequence[0] != sequence[2]:
        q = quat_product(q, quat_from_rotvec(0.5 * np.pi * _axis(sequence[1])))
    w, along, across = q[:, 0], q[:, 1 + i], q[:, 1 + j]
    third = _handedness(sequence) * q[:, 1 + 3 - i - j]
    both = np.arctan2(along, w)
    apart = np.arctan2(third, across)
    middle = 2.0 * np.arctan2(np.hypot(across, third), np.hypot(w, along))
    return np.stack([wrap(both + apart), middle, wrap(both - apart)], axis=1)


def _as_named(proper: Floats, sequence: str) -> Floats:
    if sequence[0] == sequence[2]:
        return proper
    return (proper - [0.0, 0.5 * np.pi, 0.0]) * [1.0, 1.0, -_handedness(sequence)]


def _as_proper(named: Floats, sequence: str) -> Floats:
    if sequence[0] == sequence[2]:
        return named
    return named * [1.0, 1.0, -_handedness(sequence)] + [0.0, 0.5 * np.pi, 0.0]


def _near_zero(named: Floats) -> Floats:
    """The same angles less the full turns by which the median of each is away from 0."""
    return np.asarray(named - 2.0 * np.pi * np.round(np.median(named, axis=0) / (2.0 * np.pi)))


def _near_pole(proper: Floats) -> Bools:
    near: Bools = np.minimum(proper[:, 1], np.pi - proper[:, 1]) < NEAR_SINGULAR_RAD
    return near


def _other(proper: Floats) -> Floats:
    """The same rotations by the triple across the pole."""
    return np.asarray(proper * [1.0, -1.0, 1.0] + [np.pi, 0.0, np.pi])


def _continuous(proper: Floats) -> Floats:
    clear = np.flatnonzero(~_near_pole(proper))
    if not clear.size:
        return np.unwrap(proper, axis=0)
    result = np.empty_like(proper)
    result[clear] = _chained(proper[clear])
    close = np.flatnonzero(_near_pole(proper))
    line = np.stack([np.interp(close, clear, result[clear, k]) for k in range(3)], axis=1)
    result[close] = _nearest(proper[close], line)
    return result


def _chained(proper: Floats) -> Floats:
    """Each triple nearest to the one before it. Two triples are as far apart as their other ones: parity tells."""
    step = wrap(np.diff(proper, axis=0))
    across = wrap(_other(proper)[1:] - proper[:-1])
    crossed = np.cumsum(np.sum(across**2, axis=1) < np.sum(step**2, axis=1)) % 2 == 1
    chosen = proper.copy()
    chosen[1:][crossed] = _other(proper)[1:][crossed]
    return np.unwrap(chosen, axis=0)


def _nearest(proper: Floats, wanted: Floats) -> Floats:
    near = [wanted + wrap(triple - wanted) for triple in (proper, _other(proper))]
    far = [np.sum((triple - wanted) ** 2, axis=1, keepdims=True) for triple in near]
    return np.where(far[0] <= far[1], near[0], near[1])
