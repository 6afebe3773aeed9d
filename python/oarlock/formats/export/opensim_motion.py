"""Converts a track to the coordinates of an OpenSim model: values, rates, standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.formats.export.opensim_body import SEQUENCE, CoordinateSource
from oarlock.model.angle_sequence import angle_stds, angles_from_quat, angles_per_turn
from oarlock.model.coordinates import JointPart, with_untold_at_zero
from oarlock.model.rotation import quat_from_rotvec
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock.tracking.track import Track


@dataclass(frozen=True, eq=False)
class OpensimMotion:
    """The numbers of the tables, (T, n) each, SI and rad.

    Args:
        names: names of the columns: the coordinates of the OpenSim model.
        turns: (n,) whether a column is an angle.
        value: rad or m; 0 for a joint without any stream, NaN where single readings are missing.
        rate: time derivatives of the values; NaN if the track has none.
        std: standard deviations of the values; NaN if the track has none.
    """

    names: tuple[str, ...]
    turns: tuple[bool, ...]
    value: Floats
    rate: Floats
    std: Floats


def opensim_motion(track: Track, coordinates: Sequence[CoordinateSource]) -> OpensimMotion:
    """The track's estimates as an OpenSim model's coordinates."""
    q = with_untold_at_zero(track.q)
    units = dict(zip(track.coordinate_names, track.coordinate_units, strict=True))
    by_part = {source.part: None for source in coordinates}
    numbers = {part: _numbers(track, q, part) for part in by_part}
    columns = [tuple(array[:, source.axis] for array in numbers[source.part]) for source in coordinates]
    value, rate, std = (
        np.stack([column[k] for column in columns], axis=1) if columns else np.empty((len(track.time_s), 0))
        for k in range(3)
    )
    turns = tuple(units[track.coordinate_names[s.part.columns[0]]] == "rad" for s in coordinates)
    return OpensimMotion(tuple(source.name for source in coordinates), turns, value, rate, std)


def _numbers(track: Track, q: Floats, part: JointPart) -> tuple[Floats, Floats, Floats]:
    columns = list(part.columns)
    value, rate, std = q[:, columns], track.qd[:, columns], track.q_std[:, columns]
    if part.kind != "rotation":
        return value, rate, std
    angles = angles_from_quat(quat_from_rotvec(value), SEQUENCE)
    # a track has body rates of a rotation, the table has derivatives of its angles
    with np.errstate(invalid="ignore"):
        rates = np.einsum("tij,tj->ti", angles_per_turn(angles, SEQUENCE), rate)
    return angles, _finite(rates), _finite(angle_stds(angles, SEQUENCE, std))


def _finite(values: Floats) -> Floats:
    """NaN at a pole, where an angle's rate is infinite."""
    return np.where(np.isfinite(values), values, np.nan)
