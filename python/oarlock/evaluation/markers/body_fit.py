"""`fit_body`: lengths of a person, marker positions and pose of the measuring system, from a marker trial."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from oarlock.evaluation.markers.attachments import Attachment, GivenAttachments, attachments_of, check_frames
from oarlock.evaluation.markers.least_squares import MarkerObservation, Prior, with_prior
from oarlock.evaluation.markers.point_tree import PointTree
from oarlock.evaluation.markers.start import anchor_postures, body_prior, first_posture
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.model.chain_geometry import posture
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.recording.calibration import Calibration
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, shown
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

_MOST_ROUNDS: Final = 40
_ROUNDS_A_HEADING: Final = 10
_HEADINGS: Final = 8
_PLACE_STD: Final = np.array([10.0, 10.0, 10.0, 3.0, 3.0, 3.0])
"""Weak prior of the measuring system's pose, m and rad: a free root joint leaves this pose undetermined."""
_OFFSET_STD_M: Final = 0.1
_UNKNOWN_STD_M: Final = 0.1
"""Prior of a length without a standard deviation in the model file, m."""


@dataclass(frozen=True, eq=False)
class BodyFit:
    """Result of `fit_body`.

    Args:
        parameters: the model's parameters that were estimated, m.
        parameter_std: their standard deviations, from the normal equations and the residuals.
        attachments: all attachments; the requested ones have their estimated positions.
        root_from_markers: (4, 4) pose of the measuring system in root axes.
        rms_m: root mean square distance of markers and model points in the frames that were used, m.
        frames: number of these frames.
        notes: parameters that the trial does not determine better than their prior.
    """

    parameters: Mapping[str, float]
    parameter_std: Mapping[str, float]
    attachments: tuple[Attachment, ...]
    root_from_markers: Floats
    rms_m: float
    frames: int
    notes: tuple[str, ...]

    def calibration(self) -> Calibration:
        """The lengths as a calibration, for `oarlock.track`."""
        noted = {"markers": {"rms_m": self.rms_m, "frames": self.frames, "std_m": dict(self.parameter_std)}}
        return Calibration(parameters=self.parameters, noted=noted)


@dataclass(frozen=True, eq=False)
class _Guess:
    """All unknowns: lengths, points, pose, and the postures of the frames."""

    lengths: Floats
    points: Floats
    pose: Floats
    q: Floats


class _BodyFitProblem:
    """Residuals of the chosen frames, and their derivatives by all constants."""

    def __init__(
        self,
        model: Model,
        markers: Markers,
        used: Sequence[Attachment],
        names: Sequence[str],
        free: Sequence[int],
        place: bool,
    ) -> None:
        self.model, self.names, self.free, self.place = model, tuple(names), tuple(free), place
        self.used, self.weight = tuple(used), markers.seen / np.array([a.std_m for a in used])
        self.position = np.nan_to_num(markers.position_m)
        self.mean, self.std = body_prior(model)
        self.start_lengths = np.array([model.parameters[name] for name in names])
        self.length_std = np.array([_known_std(model, name) for name in names])
        self.start_points = np.array([a.point_m for a in used])
        self.constant_std = np.concatenate(
            [self.length_std, np.full(3 * len(free), _OFFSET_STD_M), _PLACE_STD if place else np.empty(0)]
        )

    def tree(self, guess: _Guess) -> PointTree:
        """The model's points for given unknowns."""
        values = self.model.parameters | dict(zip(self.names, guess.lengths, strict=True))
        lengths = np.array([values[name] for name in self.model.length_names])
        points = [replace(a, point_m=p) for a, p in zip(self.used, guess.points, strict=True)]
        return PointTree(self.model, points, lengths)

    def sight(self, guess: _Guess) -> MarkerObservation:
        """The markers in root axes."""
        return MarkerObservation(self.position @ guess.pose[:3, :3].T + guess.pose[:3, 3], self.weight)

    def residual(self, guess: _Guess) -> Floats:
        """Residuals (T, n, 3) in standard deviations; 0 where not visible."""
        sight = self.sight(guess)
        return np.asarray((sight.place_m - self.tree(guess).at(guess.q)) * sight.weight[..., None])

    def constant_residual(self, guess: _Guess) -> Floats:
        """Changes of lengths and points from their priors, in standard deviations; the pose has none."""
        moved = (guess.points - self.start_points)[list(self.free)].ravel() / _OFFSET_STD_M
        return np.concatenate([(guess.lengths - self.start_lengths) / self.length_std, moved])

    def cost(self, guess: _Guess) -> float:
        """Sum of squares of residuals and of the deviations of postures and constants from their priors."""
        away = self.tree(guess).minus(guess.q, np.tile(self.mean, (len(guess.q), 1))) / self.std
        parts = (self.residual(guess), away, self.constant_residual(guess))
        return float(sum(np.sum(part**2) for part in parts))

    def slopes(self, guess: _Guess) -> tuple[Floats, Floats]:
        """Derivatives by postures (T, 3 n, c) and by constants (T, 3 n, k), in standard deviations of the priors."""
        rows = len(guess.q)
        _, by_q = self.tree(guess).with_slopes(guess.q)
        weight = self.weight[..., None, None]
        by_length = self.tree(guess).by_length(guess.q)
        columns = [by_length[..., self.model.length_names.index(name)] for name in self.names]
        columns += [column for marker in self.free for column in self._by_point(guess, marker)]
        columns += self._by_pose(guess) if self.place else []
        by_constant = np.stack(columns, axis=-1) if columns else np.zeros((*by_q.shape[:3], 0))
        scaled = by_constant * weight * self.constant_std
        return (by_q * weight * self.std).reshape(rows, -1, guess.q.shape[1]), scaled.reshape(
            rows, by_q.shape[1] * 3, -1
        )

    def moved(self, guess: _Guess, constants: Floats, q: Floats) -> _Guess:
        """The unknowns after steps in standard deviations."""
        step = constants * self.constant_std
        lengths, points = len(self.names), guess.points.copy()
        points[list(self.free)] += step[lengths : lengths + 3 * len(self.free)].reshape(-1, 3)
        pose = guess.pose
        if self.place:
            pose = np.eye(4)
            turn = matrix_from_quat(quat_from_rotvec(step[-3:]))
            middle = self._middle(guess)
            pose[:3, :3] = turn @ guess.pose[:3, :3]
            pose[:3, 3] = middle + turn @ (guess.pose[:3, 3] - middle) + step[-6:-3]
        moved_q = self.tree(guess).plus(guess.q, q * self.std)
        return _Guess(guess.lengths + step[:lengths], points, pose, moved_q)

    def _by_point(self, guess: _Guess, marker: int) -> list[Floats]:
        frame = self.model.frame_names.index(self.used[marker].frame)
        axes = self.model.forward_kinematics(guess.q)[:, frame, :3, :3]
        found = []
        for k in range(3):
            column = np.zeros((len(guess.q), len(self.used), 3))
            column[:, marker] = axes[:, :, k]
            found.append(column)
        return found

    def _by_pose(self, guess: _Guess) -> list[Floats]:
        # residual = marker minus model point, so the two derivatives have opposite signs
        places = self.sight(guess).place_m
        shifts = [np.broadcast_to(-axis, places.shape) for axis in np.eye(3)]
        return [*shifts, *(-np.cross(axis, places - self._middle(guess)) for axis in np.eye(3))]

    def _middle(self, guess: _Guess) -> Floats:
        seen = self.weight > 0.0
        return np.asarray(self.sight(guess).place_m[seen].mean(axis=0))


def fit_body(
    model: Model,
    markers: Markers,
    attachments: GivenAttachments,
    *,
    parameters: Iterable[str] = (),
    offsets: Iterable[str] = (),
    place_root: bool = False,
    root_from_markers: ArrayLike | None = None,
    start_q: Mapping[str, float] | ArrayLike | None = None,
    frames: int = 60,
    progress: Progress = None,
) -> BodyFit:
    """Fit lengths, marker positions and the pose of the measuring system to a trial in which all joints move.

    This is one least-squares problem over the postures of some frames and all constants. Postures are eliminated frame
    by frame (Schur complement), so it takes seconds. The priors of lengths are the model file's standard deviations,
    those of marker positions 0.1 m around the given positions.

    Args:
        model: the model with initial lengths.
        markers: a trial in which every joint moves; gaps are allowed.
        attachments: initial marker positions.
        parameters: names of the model's lengths to estimate.
        offsets: names of the markers whose positions are estimated, or `("all",)`.
        place_root: estimate the pose of the measuring system in root axes. The search starts from eight headings about
            the vertical; first rotate the markers so that their vertical agrees with the model's (`Markers.turned`).
        root_from_markers: (4, 4) initial pose, or the fixed pose without `place_root`; None is the identity.
        start_q: as `inverse_kinematics`.
        frames: number of frames that are used, evenly over the trial.
        progress: True shows that it runs.

    Raises:
        DataError: an unknown name, nothing to estimate, or too few frames with markers.
    """
    used = tuple(a for a in attachments_of(attachments) if a.marker in markers.names)
    names, free = tuple(parameters), _free_markers(used, tuple(offsets))
    check_frames(model, [a.frame for a in used], "attachments")
    for name in names:
        if name not in model.length_names:
            what = "is no length" if name in model.parameters else "is no parameter of the model"
            raise DataError(f'fit_body: "{name}" {what}. {did_you_mean(name, model.length_names)}')
    if not (names or free or place_root):
        raise DataError("fit_body: nothing to estimate; name parameters or offsets, or set place_root=True")
    chosen = _chosen(markers.select([a.marker for a in used]), frames) if used else markers
    problem = _BodyFitProblem(model, chosen, used, names, free, place_root)
    pose = (
        np.eye(4) if root_from_markers is None else real_array(root_from_markers, (4, 4), "root_from_markers")
    )
    with shown(progress, "fitting the body"):
        guess = _first(problem, pose, None if start_q is None else posture(model, start_q))
        best = _best(problem, guess)
    return _body(problem, best, attachments)


def _free_markers(used: Sequence[Attachment], offsets: tuple[str, ...]) -> list[int]:
    names = [a.marker for a in used]
    if offsets == ("all",):
        return list(range(len(names)))
    for name in offsets:
        if name not in names:
            raise DataError(f'fit_body: no attached marker "{name}". {did_you_mean(name, names)}')
    return [names.index(name) for name in offsets]


def _chosen(markers: Markers, frames: int) -> Markers:
    """Frames evenly over those in which at least two thirds of the largest number of markers are visible."""
    seen = markers.seen.sum(axis=1)
    good = np.flatnonzero(seen >= max(1, int(2 * seen.max() / 3)))
    if seen.max() == 0 or len(good) < 2:
        raise DataError("fit_body: too few frames have an attached marker; check the names")
    rows = np.unique(good[np.linspace(0, len(good) - 1, min(frames, len(good))).astype(int)])
    return Markers(markers.names, markers.time_s[rows], markers.position_m[rows])


def _first(problem: _BodyFitProblem, pose: Floats, start: Floats | None) -> _Guess:
    """Postures for the initial constants; with an unknown pose, for the best of eight headings."""
    rows = len(problem.weight)
    guess = _Guess(problem.start_lengths, problem.start_points, pose, np.tile(problem.mean, (rows, 1)))
    if problem.place:
        guess = min((_heading(problem, guess, k, start) for k in range(_HEADINGS)), key=lambda item: item[0])[
            1
        ]
    tree, prior = problem.tree(guess), Prior(guess.q, problem.std)
    q = anchor_postures(tree, problem.sight(guess), prior, np.arange(rows), start, None)
    return replace(guess, q=with_prior(tree, problem.sight(guess), Prior(q, problem.std), q))


def _heading(problem: _BodyFitProblem, guess: _Guess, k: int, start: Floats | None) -> tuple[float, _Guess]:
    up = np.asarray(problem.model.describe().world.up)
    turn = matrix_from_quat(quat_from_rotvec(up * 2.0 * np.pi * k / _HEADINGS))
    pose = np.eye(4)
    pose[:3, :3] = turn @ guess.pose[:3, :3]
    tree = problem.tree(guess)
    seed = int(np.argmax((problem.weight > 0.0).sum(axis=1)))
    seen = problem.weight[seed] > 0.0
    here = start[None] if start is not None else problem.mean[None]
    pose[:3, 3] = tree.at(here)[0][seen].mean(axis=0) - pose[:3, :3] @ problem.position[seed][seen].mean(
        axis=0
    )
    placed = replace(guess, pose=pose)
    one = _BodyFitProblem.__new__(_BodyFitProblem)
    one.__dict__ = problem.__dict__ | {
        "_trees": {},
        "weight": problem.weight[[seed]],
        "position": problem.position[[seed]],
    }
    prior = Prior(problem.mean[None], problem.std)
    q = first_posture(tree, one.sight(placed), prior, start)
    found = _best(one, replace(placed, q=q), _ROUNDS_A_HEADING)
    return one.cost(found), replace(found, q=guess.q)


def _best(problem: _BodyFitProblem, guess: _Guess, rounds: int = _MOST_ROUNDS) -> _Guess:
    """Levenberg-Marquardt over constants and postures together."""
    damping, cost = 1e-3, problem.cost(guess)
    for _ in range(rounds):
        constants, q = _step(problem, guess, damping)[:2]
        tried = problem.moved(guess, constants, q)
        new_cost = problem.cost(tried)
        small = max(np.abs(constants).max(initial=0.0), np.abs(q).max()) < 1e-9
        if new_cost <= cost:
            gain, guess, cost, damping = cost - new_cost, tried, new_cost, max(damping * 0.1, 1e-12)
            if small or gain <= 1e-12 * new_cost:
                break
        else:
            damping *= 10.0
            if small or damping > 1e9:
                break
    return guess


def _step(problem: _BodyFitProblem, guess: _Guess, damping: float) -> tuple[Floats, Floats, Floats]:
    """Steps of constants (k,) and postures (T, c), in standard deviations, and the constants' information (k, k)."""
    rows, width = guess.q.shape
    residual = problem.residual(guess).reshape(rows, -1)
    by_q, by_constant = problem.slopes(guess)
    away = problem.tree(guess).minus(guess.q, np.tile(problem.mean, (rows, 1))) / problem.std
    within = np.einsum("trc,trd->tcd", by_q, by_q) + np.eye(width)
    damped = within + damping * np.einsum("tcc->tc", within)[:, :, None] * np.eye(width)
    pull_q = np.einsum("trc,tr->tc", by_q, residual) - away
    across = np.einsum("trc,trk->tck", by_q, by_constant)
    solved = np.linalg.solve(damped, np.concatenate([across, pull_q[..., None]], axis=2))
    own = np.einsum("trk,trl->kl", by_constant, by_constant) + np.eye(by_constant.shape[2])
    information = own - np.einsum("tck,tcl->kl", across, solved[..., :-1])
    prior_pull = np.zeros(len(own))
    constant = problem.constant_residual(guess)
    prior_pull[: len(constant)] = constant
    pull = np.einsum("trk,tr->k", by_constant, residual) - prior_pull
    pull = pull - np.einsum("tck,tc->k", across, solved[..., -1])
    constants = np.linalg.solve(information + damping * np.diag(np.diag(own)), pull)
    q = solved[..., -1] - np.einsum("tck,k->tc", solved[..., :-1], constants)
    return constants, q, information


def _body(problem: _BodyFitProblem, guess: _Guess, attachments: GivenAttachments) -> BodyFit:
    residual = problem.residual(guess)
    information = _step(problem, guess, 0.0)[2]
    seen = int((problem.weight > 0.0).sum())
    free = max(1, 3 * seen - guess.q.size - len(information))
    scale = max(1.0, float(np.sqrt(np.sum(residual**2) / free)))
    std = np.sqrt(np.diag(np.linalg.inv(information)))[: len(problem.names)]
    loose = [name for name, s in zip(problem.names, std, strict=True) if s > 0.5]
    notes = (
        (f"not determined by this trial, so close to the model's values: {', '.join(loose)}",)
        if loose
        else ()
    )
    placed = {a.marker: replace(a, point_m=p) for a, p in zip(problem.used, guess.points, strict=True)}
    metres = (problem.sight(guess).place_m - problem.tree(guess).at(guess.q))[problem.weight > 0.0]
    return BodyFit(
        parameters=dict(zip(problem.names, map(float, guess.lengths), strict=True)),
        parameter_std=dict(zip(problem.names, map(float, std * problem.length_std * scale), strict=True)),
        attachments=tuple(placed.get(a.marker, a) for a in attachments_of(attachments)),
        root_from_markers=guess.pose,
        rms_m=float(np.sqrt(np.mean(np.sum(metres**2, axis=1)))),
        frames=len(guess.q),
        notes=notes,
    )


def _known_std(model: Model, name: str) -> float:
    std = next(p.std for p in model.describe().parameters if p.name == name)
    return float(std) if std else _UNKNOWN_STD_M
