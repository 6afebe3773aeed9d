"""Column names of a track, each with its unit, and the arrays under these names. Used by tables, files and exports."""

from __future__ import annotations

import re

import numpy as np

from oarlock.model.angle_sequence import angle_labels
from oarlock.storage.arrays import Floats
from oarlock.tracking.estimates import Estimates
from oarlock.tracking.joint_series import BallSeries

FIELDS = {
    "q": ("", ""),
    "q_std": ("std_", ""),
    "qd": ("velocity_", "_s"),
    "qd_std": ("velocity_std_", "_s"),
    "qdd": ("acceleration_", "_s2"),
    "qdd_std": ("acceleration_std_", "_s2"),
}
"""Array of the track -> text before and after the unit in a coordinate's column name."""


def column_name(coordinate: str, unit: str, field: str) -> str:
    """Column name of a coordinate's array: coordinate trunk, unit rad, field qd_std give `trunk_velocity_std_rad_s`."""
    before, behind = FIELDS[field]
    return f"{coordinate}_{before}{unit}{behind}"


def observed_name(coordinate: str) -> str:
    """Column name of a coordinate's flag `observed`, such as `trunk_observed`."""
    return f"{coordinate}_observed"


def unit_of(column: str) -> str:
    """The unit in the name of a column of `columns_of`; "1" for flags and quaternions."""
    slow = re.search(r" \[(.+)\]$", column)
    if slow is not None:
        return slow[1]
    plain = re.search(r"_(rad_s2|rad_s|rad|m_s2|m_s|m|s|deg|cm)$", column)
    return "1" if plain is None else plain[1].replace("_s", "/s")


def columns_of(track: Estimates) -> dict[str, Floats]:
    """Every array under a plain column name with its unit, (T,) each, `time_s` first."""
    found: dict[str, Floats] = {"time_s": track.time_s}
    for i, (name, unit) in enumerate(zip(track.coordinate_names, track.coordinate_units, strict=True)):
        found |= {column_name(name, unit, field): getattr(track, field)[:, i] for field in FIELDS}
        found[observed_name(name)] = track.observed[:, i].astype(np.float64)
    for name in track.joint_names:
        series = track[name]
        if isinstance(series, BallSeries):
            found |= _rotation_columns(series)
    for name, slow in track.slow.items():
        found |= {f"{name} [{slow.unit}]": slow.value, f"{name} std [{slow.unit}]": slow.std}
    return found


def _rotation_columns(series: BallSeries) -> dict[str, Floats]:
    name, sequence = series.name, series.angle_sequence
    found = {f"{name}_quat_{axis}": series.quat_wxyz[:, k] for k, axis in enumerate("wxyz")}
    angles, stds = series.angles_rad(), series.angles_std_rad()
    for k, label in enumerate(angle_labels(sequence)):
        found[f"{name}_{sequence}_{label}_rad"] = angles[:, k]
        found[f"{name}_{sequence}_{label}_std_rad"] = stds[:, k]
    found[f"{name}_{sequence}_near_singular"] = series.near_singular().astype(np.float64)
    return found
