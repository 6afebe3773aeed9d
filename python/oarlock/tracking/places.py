"""Frame positions of a track and their covariances. Used by `Track.frame_positions` and by the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from oarlock._core import Model
from oarlock.model.coordinates import with_untold_at_zero
from oarlock.model.jacobians import relative_moves
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.tracking.estimates import Estimates

Rows = slice | Ints
Source = Literal["beliefs", "deviations", "unknown"]

LENGTH_PREFIX = "parameters."
OFF_AXIS = ".off_axis_"
"""In names of slow states: turn of a link off the axes of its hinges, a rotation vector in the frame's axes."""
NO_EFFECT = 1e-8
"""A coordinate that moves a position by less than this, m per rad or per m, counts as not moving it."""
ALL = slice(None)


@dataclass(frozen=True)
class PositionSpread:
    """Uncertainty of a frame's position over time.

    Args:
        covariance_m2: (T, 3, 3) m2, in the axes of the frame to which the positions are relative. NaN where a required
            standard deviation is unknown.
        source: "beliefs": standard deviations of the coordinates at each sample, with correlations from the stored
            beliefs, interpolated between two beliefs. "deviations": coordinates treated as independent, because no
            beliefs are stored. "unknown": the track does not come from a filter.
    """

    covariance_m2: Floats
    source: Source

    @property
    def std_m(self) -> Floats:
        """Standard deviations along the three axes, (T, 3) m."""
        variance: Floats = np.diagonal(self.covariance_m2, axis1=1, axis2=2)
        return np.sqrt(np.maximum(variance, 0.0))


def poses_of(track: Estimates, rows: Rows = ALL) -> Floats:
    """Poses of all frames (T, F, 4, 4) in root axes, for the chosen rows, with the estimated lengths of each row.

    A joint without any reading is assumed to be 0; where a required reading is missing, the pose is NaN.

    Raises:
        DataError: the track has no model.
    """
    model = model_of(track, "poses_of")
    lengths = _estimated_lengths(track, model, rows)
    poses = np.asarray(model.forward_kinematics(_coordinates(track, rows), _all_lengths(model, lengths)))
    turned = {name.removesuffix(f"{OFF_AXIS}x") for name in track.slow if name.endswith(f"{OFF_AXIS}x")}
    if not turned:
        return poses
    turns = {f: np.column_stack([track.slow[f"{f}{OFF_AXIS}{a}"].value[rows] for a in "xyz"]) for f in turned}
    return _with_off_axis_turns(model, poses, turns)


def _with_off_axis_turns(model: Model, poses: Floats, turns: Mapping[str, Floats]) -> Floats:
    """Poses (T, F, 4, 4) with turns of links off the axes of their hinges, rotation vectors (T, 3) about joints."""
    moved = poses.copy()
    for f, (name, parent) in enumerate(zip(model.frame_names, model.frame_parents, strict=True)):
        if f == parent:
            continue
        local = np.linalg.inv(poses[:, parent]) @ poses[:, f]
        moved[:, f] = moved[:, parent] @ local
        if name in turns:
            joint, turn = np.asarray(model.joint_origins[f]), matrix_from_quat(quat_from_rotvec(turns[name]))
            moved[:, f, :3, 3] += (moved[:, f, :3, :3] @ (joint - turn @ joint)[..., None])[..., 0]
            moved[:, f, :3, :3] = moved[:, f, :3, :3] @ turn
    return moved


def model_of(track: Estimates, asked: str) -> Model:
    """The track's model.

    Raises:
        DataError: the track was loaded without it.
    """
    if track.model is None:
        raise DataError(f"{asked}: this track was loaded without its model; load the model file again")
    return track.model


def relative_positions(poses: Floats, frames: Sequence[int], reference: int) -> Floats:
    """Origins (T, K, 3) of frames in the axes of a reference frame, m, from poses (T, F, 4, 4)."""
    own = poses[:, reference]
    away = poses[:, frames][..., :3, 3] - own[:, None, :3, 3]
    moved: Floats = away @ own[:, :3, :3]
    return moved


def position_spreads(
    track: Estimates, frames: Sequence[int], reference: int = 0, rows: Rows = ALL
) -> tuple[Floats, Source]:
    """Covariances (T, K, 3, 3) of the frames' positions, m2, and their source; see `PositionSpread`.

    First order: J P J' with the exact Jacobian (JCGM 100, 2008, eq. 13). Lengths that are no states of the track
    are exact on trees; on strapdown links they have the standard deviations of the model file, as their joints do.

    Raises:
        DataError: the track has no model.
    """
    model = model_of(track, "position_spreads")
    lengths, stated = _estimated_lengths(track, model, rows), _stated_stds_m(track, model)
    names = [*track.coordinate_names, *lengths, *stated]
    deviations = [track.slow[LENGTH_PREFIX + name].std[rows] for name in lengths]
    count = len(track.q_std[rows])
    std = np.column_stack([track.q_std[rows], *deviations, *(np.full(count, s) for s in stated.values())])
    slopes = _slopes(model, _coordinates(track, rows), lengths, [reference, *frames], [*lengths, *stated])
    slopes[np.abs(slopes) < NO_EFFECT] = 0.0
    weighted = np.where(slopes == 0.0, 0.0, slopes * std[:, None, None, :])
    if track.beliefs is None or not len(track.beliefs.time_s):
        unknown = bool(np.isnan(track.q_std).all())
        return weighted @ np.swapaxes(weighted, 2, 3), "unknown" if unknown else "deviations"
    states = [LENGTH_PREFIX + name if name in lengths else name for name in names]
    mixed = _correlations(track, states)(track.time_s[rows])
    return weighted @ mixed[:, None] @ np.swapaxes(weighted, 2, 3), "beliefs"


def rotation_stds(track: Estimates, frame: int, reference: int) -> Floats:
    """Standard deviations (T, 3) of the rotation reference-from-frame, rad about the axes of the frame; to first order.

    Raises:
        DataError: the track has no model.
    """
    model = model_of(track, "rotation_stds")
    q = _coordinates(track, ALL)
    lengths = _all_lengths(model, _estimated_lengths(track, model, ALL))
    names = [model.frame_names[f] for f in (reference, frame)]
    by_coordinate, _ = model.frame_jacobian(q, names, lengths)
    turns = by_coordinate[:, 1, 3:] - by_coordinate[:, 0, 3:]
    axes = np.asarray(model.forward_kinematics(q, lengths))[:, frame, :3, :3]
    slopes = np.swapaxes(axes, 1, 2) @ turns
    weighted = np.where(np.abs(slopes) < NO_EFFECT, 0.0, slopes * track.q_std[:, None, :])
    if track.beliefs is None or not len(track.beliefs.time_s):
        variance = (weighted**2).sum(-1)
    else:
        mixed = _correlations(track, list(track.coordinate_names))(track.time_s)
        variance = np.einsum("tij,tjk,tik->ti", weighted, mixed, weighted)
    stds: Floats = np.sqrt(np.maximum(variance, 0.0))
    return stds


def _coordinates(track: Estimates, rows: Rows) -> Floats:
    return with_untold_at_zero(track.q)[rows]


def _estimated_lengths(track: Estimates, model: Model, rows: Rows) -> dict[str, Floats]:
    """Estimated lengths over time, by the parameter's name."""
    found = ((name.removeprefix(LENGTH_PREFIX), slow) for name, slow in track.slow.items())
    return {name: slow.value[rows] for name, slow in found if name in model.parameters}


def _stated_stds_m(track: Estimates, model: Model) -> dict[str, float]:
    """Standard deviations of the uncertain lengths of strapdown links, m, by the parameter's name."""
    config = track.provenance.get("config", {})
    if (config.get("structure") or model.structure) != "strapdown":
        return {}
    states = {name.removeprefix(LENGTH_PREFIX) for name in track.slow}
    lengths = (one for one in model.describe().parameters if one.name in model.length_names)
    return {one.name: one.std for one in lengths if one.std and one.name not in states}


def _all_lengths(model: Model, estimated: Mapping[str, Floats]) -> Floats | None:
    """Lengths of each row (T, n_lengths); None if all are the model's."""
    if not estimated:
        return None
    of_all = [np.asarray(estimated.get(name, model.parameters[name])) for name in model.length_names]
    return np.stack(np.broadcast_arrays(*of_all), axis=-1)


def _slopes(
    model: Model, q: Floats, lengths: Mapping[str, Floats], frames: Sequence[int], uncertain: Sequence[str]
) -> Floats:
    """Derivatives (T, K, 3, n) of positions in the axes of the first frame, by coordinates and uncertain lengths."""
    of_rows = _all_lengths(model, lengths)
    poses = np.asarray(model.forward_kinematics(q, of_rows))[:, frames]
    by_coordinate, by_length = model.frame_jacobian(q, [model.frame_names[f] for f in frames], of_rows)
    by_length = by_length[..., [model.length_names.index(name) for name in uncertain]]
    moves = np.concatenate([by_coordinate[..., :3, :], by_length], axis=-1)
    turns = np.concatenate([by_coordinate[..., 3:, :], np.zeros_like(by_length)], axis=-1)
    return relative_moves(poses, np.concatenate([moves, turns], axis=-2))


def _correlations(track: Estimates, states: Sequence[str]) -> Callable[[Floats], Floats]:
    """Correlations (T, n, n) of these states at any times; quantities that are not states are independent."""
    beliefs = track.beliefs
    assert beliefs is not None
    known = {name: k for k, name in enumerate(beliefs.state_names)}
    there = [k for k, name in enumerate(states) if name in known]
    columns = [known[states[k]] for k in there]
    kept = np.tile(np.eye(len(states)), (len(beliefs.time_s), 1, 1))
    own = beliefs.covariance[:, columns][:, :, columns]
    std = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
    scale = std[:, :, None] * std[:, None, :]
    kept[np.ix_(range(len(kept)), there, there)] = np.where(
        scale > 0.0, own / np.where(scale > 0, scale, 1.0), 0.0
    )
    kept[:, range(len(states)), range(len(states))] = 1.0

    def at(time_s: Floats) -> Floats:
        place = np.interp(time_s, beliefs.time_s, np.arange(len(kept), dtype=np.float64))
        before = np.minimum(place.astype(np.int64), len(kept) - 1)
        after = np.minimum(before + 1, len(kept) - 1)
        share = (place - before)[:, None, None]
        mixed: Floats = (1.0 - share) * kept[before] + share * kept[after]
        return mixed

    return at
