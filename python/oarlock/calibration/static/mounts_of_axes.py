"""`solved_mounts`: the most likely mounts, from hinge axes weighted by what the motion shows, and a prior.

`calibrate_hinge_axes` uses it. The prior has the nominal mounts as mean, so nothing is turned further than it is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.calibration.static.prior_width import prior_share
from oarlock.model.rotation import angle_between
from oarlock.storage.arrays import Floats

STEPS = 50
SETTLED_RAD = 1e-10


@dataclass(frozen=True, eq=False)
class SeenAxis:
    """What the motion shows of one hinge's axis in two units.

    Args:
        units: parent, child.
        in_link: (2, 3) unit vectors, by the model.
        in_sensor: (2, 3) unit vectors, as found.
        information: (6, 6) of small changes of `in_sensor`, 1/rad2, of the motion alone.
        pull: (6,) its vector, 1/rad.
    """

    units: tuple[str, str]
    in_link: Floats
    in_sensor: Floats
    information: Floats
    pull: Floats


@dataclass(frozen=True, eq=False)
class LikelyMount:
    """A mount.

    Args:
        link_from_sensor: (3, 3).
        turn_rad: (3,) rotation vector from the nominal mount, about the link's axes.
        covariance: (3, 3) rad2, of small turns about the link's axes.
    """

    link_from_sensor: Floats
    turn_rad: Floats
    covariance: Floats


def solved_mounts(
    nominal: Mapping[str, Floats], prior_stds_rad: Mapping[str, Floats], axes: Sequence[SeenAxis]
) -> dict[str, LikelyMount]:
    """The most likely mounts of all units that have a prior (maximum a posteriori).

    The prior's width is the most likely one (`prior_share`). The covariance is the mean square error under the
    stated one.

    Args:
        nominal: unit -> (3, 3) link from sensor; of units without a prior exactly known.
        prior_stds_rad: unit -> (3,) standard deviations about the link's axes.
        axes: of the hinges between units.
    """
    names = list(prior_stds_rad)
    std = np.concatenate([np.asarray(prior_stds_rad[name]) for name in names])
    prior = std**-2.0
    stated, information = _most_likely(nominal, names, prior, axes)
    share = prior_share(information - np.diag(prior), std, stated.as_rotvec().reshape(-1))
    kept = _most_likely(nominal, names, prior / share**2, axes)[0] if share else Rotation.identity(len(names))
    covariance = np.linalg.inv(information).reshape(len(names), 3, len(names), 3)
    apart, solved, turned = (kept * stated.inv()).as_rotvec(), _mounts(names, kept, nominal), kept.as_rotvec()
    return {
        name: LikelyMount(
            solved[name], turned[k], np.asarray(covariance[k, :, k]) + np.outer(apart[k], apart[k])
        )
        for k, name in enumerate(names)
    }


def _most_likely(
    nominal: Mapping[str, Floats], names: Sequence[str], prior: Floats, axes: Sequence[SeenAxis]
) -> tuple[Rotation, Floats]:
    """Turns from the nominal mounts by Gauss-Newton steps, and their information (3 n, 3 n)."""
    turns = Rotation.identity(len(names))
    for _ in range(STEPS):
        mounts = {**nominal, **_mounts(names, turns, nominal)}
        information, pull = np.diag(prior), -prior * turns.as_rotvec().reshape(-1)
        for axis in axes:
            slopes, change = _seen(axis, mounts, names)
            information += slopes.T @ axis.information @ slopes
            pull += slopes.T @ (axis.pull - axis.information @ change)
        step = np.linalg.solve(information, pull).reshape(-1, 3)
        turns = Rotation.from_rotvec(step) * turns
        if np.abs(step).max() < SETTLED_RAD:
            break
    return turns, information


def _mounts(names: Sequence[str], turns: Rotation, nominal: Mapping[str, Floats]) -> dict[str, Floats]:
    turned = turns.as_matrix()
    return {name: turned[k] @ nominal[name] for k, name in enumerate(names)}


def _seen(axis: SeenAxis, mounts: Mapping[str, Floats], names: Sequence[str]) -> tuple[Floats, Floats]:
    """(6, 3 n) derivatives of a hinge's axes in the sensors by turns of the mounts, and (6,) how far they are off."""
    slopes, change = np.zeros((6, 3 * len(names))), np.zeros(6)
    for end, name in enumerate(axis.units):
        part, mount, found = slice(3 * end, 3 * end + 3), mounts[name], axis.in_sensor[end]
        change[part] = np.cross(_from_to(found, mount.T @ axis.in_link[end]), found)
        if name in names:
            column = 3 * names.index(name)
            slopes[part, column : column + 3] = mount.T @ np.cross(axis.in_link[end], np.eye(3)).T
    return slopes, change


def _from_to(one: Floats, two: Floats) -> Floats:
    """(3,) the smallest rotation vector that takes a unit vector to another."""
    across = np.cross(one, two)
    sine = float(np.linalg.norm(across))
    return np.asarray(across * (angle_between(one, two) / sine)) if sine > 0.0 else across
