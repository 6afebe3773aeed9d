"""`calibrate_joint_centers`: sensor positions and lengths between joints, from motion.

The search itself is the engine's (`calibrate::joint_centers`); docs/mounts.md explains it and shows an example.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import block_diag

from oarlock import _core
from oarlock.calibration.static.link_pairs import EXACT, ROOT, LinkPair, link_pairs
from oarlock.calibration.static.offset_parameters import offset_parameters, own_parameters
from oarlock.calibration.static.prior_width import prior_share
from oarlock.calibration.static.worn_model import Worn
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

SEARCH = "joint centers"

WELL_KNOWN_M = 0.05
"""Distances between the ends of a joint are compared in directions that are known as well as this."""

LITTLE_LEARNT = 0.7
"""What keeps this share of its prior standard deviation, or 5 cm, is reported as hardly found."""

JOINT_STD_M = 0.01
"""A joint between bodies is no point: what this adds to the standard deviation of a position."""


def calibrate_joint_centers(
    model: Model,
    recording: Recording,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    window_s: float = 0.2,
    prior_std_m: float = 0.3,
    root_at_rest: bool | None = None,
) -> Calibration:
    """Find where joints lie from motion alone: offsets of the units, and lengths between joints.

    For every two bodies with a unit each and a joint between them, gyroscopes and accelerometers give the vector
    from the joint to each unit, in the unit's own axes. The mounts' rotations bring it to the links. What the
    motion does not determine stays near the model's value: always a hinge's place along its axis.

    Args:
        model: says which joints lie between which units. A unit without a joint above it keeps its offset if
            three lengths can place a joint below it; that is found from there.
        recording: gyroscope and accelerometer of the units, moving in all directions.
        sensors: the units to use, one a body; None takes all of the model that were recorded.
        calibration: mounts and lengths to start from; None takes the model's.
        window_s: over which readings are averaged, s. Soft mounting asks for 0.2 to 0.4, a quick hand for 0.1.
        prior_std_m: how well the model knows each coordinate before the motion is seen, m. Parameters that have a
            standard deviation of their own in the model file keep to that, and so do offsets of units that are three
            such parameters. ``mount_offset_stds_m`` of the calibration comes first.
        root_at_rest: whether joints between the root and the first units are found too; None: if the model has
            neither a base acceleration nor a free joint.

    Returns:
        The starting calibration with the offsets of the units, and every length that moves a joint which was
        found. An offset that the model file writes as three parameters of its own is set by these (unless the
        starting calibration holds the unit's mount), so that ``Config(estimate=["lengths"])`` can go on from it.
        ``noted`` holds standard deviations, loose directions, residuals, and by how much joints still miss one
        another because lengths are fixed numbers (``left_m``).

    Raises:
        DataError: no two units with a joint between them, two units on one body, a stream without gyroscope or
            accelerometer, or no common stretch of time; with names and figures.
    """
    names = chosen_units(model, recording, sensors, SEARCH)
    recording = corrected(recording, calibration)
    require_plausible(recording.only(names))
    worn = Worn.of(model, calibration)
    pairs = link_pairs(worn.model, names, SEARCH, root_at_rest)
    centered = [pair for pair in pairs if pair.center is not None]
    if not centered:
        raise DataError(
            f"{SEARCH}: no joint with a centre lies between two of the units {', '.join(names)} of "
            f'"{model.name}". Put a unit on both sides of a joint, or name other sensors.'
        )
    found = [_found(pair, worn, recording, window_s, prior_std_m) for pair in centered]
    tree = Tree.of(worn, centered, prior_std_m)
    solved = tree.solve(found)
    named = offset_parameters(worn, solved.offsets, solved.parameters)
    separate = dict(pair for values in named.values() for pair in values.items())
    offsets = {name: offset for name, offset in solved.offsets.items() if name not in named}
    mounts = {name: (worn.rotations[name], offset) for name, offset in offsets.items()}
    noted = _noted(recording, names, pairs, dict(zip(centered, found, strict=True)), solved)
    stds = {name: np.hypot(solved.offset_stds[name], JOINT_STD_M) for name in offsets}
    return worn.calibrated(mounts, noted, {**solved.parameters, **separate}, mount_offset_stds_m=stds)


def _found(
    pair: LinkPair, worn: Worn, recording: Recording, window_s: float, prior_std_m: float
) -> dict[str, Any]:
    """The engine's finding, with the expectation of the model in sensor axes."""
    first, second = worn.read(pair, recording)
    levers_m = [lever.tolist() for lever in worn.levers(pair)]
    return _core.find_joint_center(first, second, levers_m, window_s, prior_std_m)


# --- one tree from all joints -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Solved:
    """Offsets (3,) m, parameters, standard deviations m of both, what joints still miss (6,) m, what was kept."""

    offsets: Mapping[str, Floats]
    parameters: Mapping[str, float]
    offset_stds: Mapping[str, Floats]
    parameter_stds: Mapping[str, float]
    left: Mapping[str, Floats]
    kept: list[str]


@dataclass(frozen=True, eq=False)
class Tree:
    """The unknowns of a tree of bodies, and how each joint's two levers follow from them.

    A lever is the unit's offset less the joint's centre in its link; centres move with the model's lengths.

    Args:
        worn: the model's values.
        pairs: joints with a centre.
        columns: unit -> its three unknowns. The lengths' stand behind them, in the order of `slopes`.
        slopes: length -> (n_pairs, 6) how the centres move with it, m per m.
        prior: (size,) standard deviations of the model's values, m.
        search_std_m: standard deviation with which each joint was sought about the model's values.
    """

    worn: Worn
    pairs: Sequence[LinkPair]
    columns: Mapping[str, slice]
    slopes: Mapping[str, Floats]
    prior: Floats
    search_std_m: float

    @classmethod
    def of(cls, worn: Worn, pairs: Sequence[LinkPair], prior_std_m: float) -> Tree:
        """Unknown are the offsets of the units and the lengths that move a centre."""
        slopes = _slopes(worn.model, pairs)
        stds = {p.name: p.std or prior_std_m for p in worn.model.describe().parameters}
        columns: dict[str, slice] = {}
        prior: list[float] = []
        own = own_parameters(worn, slopes)
        for name in _unknown_units(pairs, slopes):
            columns[name] = slice(len(prior), len(prior) + 3)
            named = [stds[parameter] for parameter in own.get(name, ())] or [prior_std_m] * 3
            prior += list(worn.before.mount_offset_stds_m.get(name, named))
        prior += [stds[name] for name in slopes]
        return cls(worn, pairs, columns, slopes, np.array(prior), prior_std_m)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.prior)

    @property
    def lengths(self) -> Mapping[str, int]:
        """Length -> its unknown; a length may have the name of a unit."""
        return {name: 3 * len(self.columns) + k for k, name in enumerate(self.slopes)}

    def design(self, pair: LinkPair) -> Floats:
        """(6, size) slopes of a joint's levers."""
        rows = np.zeros((6, self.size))
        for i, name in enumerate(pair.units):
            if name in self.columns:
                rows[3 * i : 3 * i + 3, self.columns[name]] = np.eye(3)
        for name, slope in self.slopes.items():
            rows[:, self.lengths[name]] -= slope[self.pairs.index(pair)]
        return rows

    def solve(self, found: Sequence[Mapping[str, Any]]) -> Solved:
        """The most likely values, with those of the model as prior (maximum a posteriori).

        The prior's width is the most likely one (`prior_share`). The covariance is the mean square error under the
        stated one.
        """
        information = np.diag(self.prior**-2)
        vector = np.zeros(self.size)
        missing, known = {}, {}
        for pair, joint in zip(self.pairs, found, strict=True):
            turned, rows = block_diag(*(self.worn.rotations[name] for name in pair.units)), self.design(pair)
            measured_m = np.concatenate([joint["first_m"], joint["second_m"]])
            difference = turned @ (measured_m - np.concatenate(self.worn.levers(pair)))
            covariance = np.asarray(turned @ np.asarray(joint["covariance_m2"]) @ turned.T)
            whole = np.linalg.inv(covariance)
            information += rows.T @ _without_prior(whole, self.search_std_m) @ rows
            vector += rows.T @ whole @ difference
            missing[pair.label], known[pair.label] = difference, _tight(covariance)
        covariance = np.asarray(np.linalg.inv(information))
        stated = covariance @ vector
        motion = information - np.diag(self.prior**-2)
        share = prior_share(motion, self.prior, stated)
        prior = np.diag((share * self.prior) ** -2) if share else None
        moved = 0.0 * stated if prior is None else np.asarray(np.linalg.solve(motion + prior, vector))
        return self._solved(moved, np.sqrt(np.diag(covariance) + (moved - stated) ** 2), missing, known)

    def _solved(
        self,
        moved: Floats,
        std: Floats,
        difference: Mapping[str, Floats],
        tight: Mapping[str, Floats],
    ) -> Solved:
        offsets = {name: self.worn.offsets[name] + moved[part] for name, part in self.columns.items()}
        parameters = {n: self.worn.model.parameters[n] + float(moved[k]) for n, k in self.lengths.items()}
        offset_stds = {name: std[part] for name, part in self.columns.items()}
        parameter_stds = {name: float(std[k]) for name, k in self.lengths.items()}
        left = {p.label: tight[p.label] @ (difference[p.label] - self.design(p) @ moved) for p in self.pairs}
        little = std > np.minimum(LITTLE_LEARNT * self.prior, WELL_KNOWN_M)
        kept = [
            f"{name}: offset along {axis} of its link"
            for name, part in self.columns.items()
            for axis, unknown in zip("xyz", little[part], strict=True)
            if unknown
        ]
        kept += [name for name, k in self.lengths.items() if little[k]]
        return Solved(offsets, parameters, offset_stds, parameter_stds, left, kept)


def _without_prior(information: Floats, prior_std_m: float) -> Floats:
    """What the motion alone shows: information (6, 6) less that of the prior with which it was sought."""
    motion, directions = np.linalg.eigh(information - np.eye(6) / prior_std_m**2)
    return np.asarray(directions * np.maximum(motion, 0.0) @ directions.T)


def _tight(covariance: Floats) -> Floats:
    """Projection on the directions that are well known; the others are independent of them."""
    variances, directions = np.linalg.eigh(covariance)
    kept = directions[:, variances < WELL_KNOWN_M**2]
    return np.asarray(kept @ kept.T)


def _unknown_units(pairs: Sequence[LinkPair], slopes: Mapping[str, Floats]) -> list[str]:
    """Units whose offset is to be found: those below a joint, and those above joints that no lengths place freely.

    Where lengths can place one, the unit's own place would only shift all that hangs on it.
    """
    moves = np.array(list(slopes.values())).reshape(-1, len(pairs), 6)
    free = [bool(np.linalg.matrix_rank(moves[:, i, :3]) == 3) for i in range(len(pairs))]
    anchored = {pair.parent for pair, placed in zip(pairs, free, strict=True) if placed} | {ROOT}
    below = [pair.child for pair in pairs]
    above = [pair.parent for pair in pairs if pair.parent not in anchored]
    return list(dict.fromkeys(below + above))


def _slopes(model: Model, pairs: Sequence[LinkPair]) -> dict[str, Floats]:
    """(n_pairs, 6) derivatives of the centres by each length that moves one."""
    slopes = np.array([pair.center_by_length for pair in pairs])
    moving = (np.abs(slopes) > EXACT).any(axis=(0, 1))
    return {name: slopes[..., k] for k, name in enumerate(model.length_names) if moving[k]}


# --- what is noted ------------------------------------------------------------------------------------


def _noted(
    recording: Recording,
    names: Sequence[str],
    pairs: Sequence[LinkPair],
    found: Mapping[LinkPair, Mapping[str, Any]],
    solved: Solved,
) -> dict[str, Any]:
    return {
        "how": "joint centers from motion",
        "joint": {pair.label: _joint_note(pair, joint, solved) for pair, joint in found.items()},
        "offset_std_m": {name: std.tolist() for name, std in solved.offset_stds.items()},
        "parameter_std_m": dict(solved.parameter_stds),
        "without_center": [pair.label for pair in pairs if pair.center is None],
        "kept_nominal": solved.kept,
        "left_out": [name for name in recording.names if name not in names],
    }


def _joint_note(pair: LinkPair, joint: Mapping[str, Any], solved: Solved) -> dict[str, Any]:
    """Texts, numbers and tables only, so that a file can hold them."""
    figures = {k: v for k, v in joint.items() if k != "covariance_m2"}
    if pair.parent == ROOT:
        # A unit at rest tells nothing of its own place.
        figures["loose"] = [way for way in joint["loose"] if np.linalg.norm(way["second"]) > 0.1]
    left = solved.left[pair.label]
    return {
        "parent": pair.parent,
        "child": pair.child,
        **figures,
        "left_m": [float(np.linalg.norm(part)) for part in (left[:3], left[3:])],
    }
