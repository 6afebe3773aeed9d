"""Quaternions w first, as files and results hold them, to scipy's rotations and back."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from oarlock.storage.arrays import Bools, Floats

AXES = {"x": 0, "y": 1, "z": 2}


def rotation(quat_wxyz: Floats) -> Rotation:
    """Rows of (T, 4), none of them missing."""
    return Rotation.from_quat(np.asarray(quat_wxyz)[..., [1, 2, 3, 0]])


def quat_wxyz(turn: Rotation) -> Floats:
    """(T, 4) of T rotations, (4,) of one."""
    return np.asarray(turn.as_quat()[..., [3, 0, 1, 2]])


def at(time_s: Floats, quats: Floats, at_s: Floats) -> tuple[Rotation, Bools]:
    """Orientations between samples, on the shortest way from one to the next.

    Returns:
        Rotations at the wanted times, and which of them are real: those outside the samples, or beside a missing
        one, are the identity.
    """
    there: Bools = np.asarray(np.isfinite(quats).all(axis=1))
    inside = (at_s >= time_s[0]) & (at_s <= time_s[-1])
    after = np.clip(np.searchsorted(time_s, at_s, side="left"), 0, len(time_s) - 1)
    exact = time_s[after] == at_s
    before = np.where(exact, after, np.maximum(after - 1, 0))
    good = inside & there[after] & there[before]
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (len(at_s), 1))
    if good.any():
        slerp = Slerp(time_s[there], rotation(quats[there]))
        rotations[good] = quat_wxyz(slerp(at_s[good]))
    return rotation(rotations), good


def twist_rad(turn: Rotation, axis: str) -> Floats:
    """The part of each rotation that goes about a fixed axis (swing and twist, Dobrowolski 2015), -pi to pi."""
    quat = turn.as_quat()
    return wrapped(2.0 * np.arctan2(quat[..., AXES[axis]], quat[..., 3]))


def wrapped(angle_rad: Floats) -> Floats:
    """The same angle in -pi to pi."""
    return np.asarray((np.asarray(angle_rad) + np.pi) % (2.0 * np.pi) - np.pi)


def about_vertical(angle_rad: float | Floats) -> Rotation:
    """Rotation about the world's z."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    return Rotation.from_rotvec(angle[..., None] * np.array([0.0, 0.0, 1.0]))
