"""Curves of the viewer: one panel per quantity, right and left in the same panel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.model.angle_sequence import angle_labels
from oarlock.model.coordinates import joint_columns
from oarlock.report.viewer.packing import packed
from oarlock.report.viewer.sides import Side, side_of
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.tracking.joint_series import BallSeries, FreeSeries, JointSeries

if TYPE_CHECKING:
    from oarlock.tracking.track import Track


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity over time, in the shown unit.

    Args:
        key: short name, unique; curves of two tracks with the same key are drawn over each other.
        label: what it is.
        unit: of the values as shown, such as "deg".
        value: (T,) on the track's `time_s`; NaN is a gap.
        std: (T,) standard deviation, in the same unit; None if there is none.
        panel: curves with the same text here share a panel; empty: one of its own.
        side: "right" or "left" sets the colour.
        hint: what a positive value means, in a sentence.
    """

    key: str
    label: str
    unit: str
    value: Floats
    std: Floats | None = None
    panel: str = ""
    side: Side = ""
    hint: str = ""


def joint_curves(track: Track) -> tuple[Curve, ...]:
    """Every observed joint, angles in degrees and positions in millimetres; named angles of ball and free joints."""
    joints = () if track.model is None else track.model.describe().joints
    labels, columns = (
        {joint.name: joint.label or "" for joint in joints},
        joint_columns(track.coordinate_names),
    )
    seen = [name for name in track.joint_names if track.observed[:, list(columns[name])].any()]
    curves = [curve for name in seen for curve in _of_joint(track[name], labels.get(name, ""))]
    return tuple(curve for curve in curves if np.isfinite(curve.value).any())


def packed_panels(
    curves: Sequence[Curve], rows: Ints, count: int, first: Sequence[str]
) -> list[dict[str, Any]]:
    """Panels in the order of their first curve, as plain data; those named in `first` come first and are open.

    Raises:
        DataError: a curve does not have `count` values, or two have the same key.
    """
    panels: dict[str, list[Curve]] = {}
    for curve in curves:
        if len(curve.value) != count or (curve.std is not None and len(curve.std) != count):
            raise DataError(
                f'curve "{curve.key}": {len(curve.value)} values; the track has {count} samples. '
                "Give values and std on the track's time_s."
            )
        panels.setdefault(curve.panel or curve.key, []).append(curve)
    keys = [curve.key for curve in curves]
    twice = [key for key in dict.fromkeys(keys) if keys.count(key) > 1]
    if twice:
        raise DataError(f'curve "{twice[0]}": there are two with this key; each needs its own')
    wanted = [key for key in first if key in panels] or _largest_ranges(panels)
    order = [*wanted, *(key for key in panels if key not in wanted)]
    return [_panel(key, panels[key], rows, key in wanted) for key in order]


AT_FIRST = 4
"""Number of panels that are open by default."""


def _largest_ranges(panels: Mapping[str, Sequence[Curve]]) -> list[str]:
    """The panels with the largest ranges; degrees and millimetres count the same."""

    def travel(key: str) -> float:
        return max(float(np.nanmax(c.value) - np.nanmin(c.value)) for c in panels[key])

    best = sorted(panels, key=travel, reverse=True)[:AT_FIRST]
    return [key for key in panels if key in best]


def _panel(key: str, curves: Sequence[Curve], rows: Ints, opened: bool) -> dict[str, Any]:
    one, name = curves[0], key.replace("_", " ")
    alone = f"{one.label} {name}" if one.side else one.label
    label, series = name if len(curves) > 1 else alone, [_series(curve, rows) for curve in curves]
    return {"key": key, "label": label, "unit": one.unit, "open": opened, "series": series}


def _series(curve: Curve, rows: Ints) -> dict[str, Any]:
    known = curve.std is not None and np.isfinite(curve.std[rows]).any()
    return {
        "key": curve.key,
        "label": curve.label,
        "side": curve.side,
        "hint": curve.hint,
        "value": packed(curve.value[rows, None]),
        "std": packed(curve.std[rows, None]) if known and curve.std is not None else None,
    }


def _of_joint(series: JointSeries | BallSeries, label: str) -> Iterator[Curve]:
    side, stem = side_of(series.name)
    plain = stem.replace("_", " ")
    if isinstance(series, JointSeries):
        scale, unit = (1e3, "mm") if series.unit == "m" else (180.0 / np.pi, "deg")
        values, std = scale * series.value, scale * series.std
        yield Curve(series.name, side or plain, unit, values, std, stem if side else "", side, label)
        return
    if isinstance(series, FreeSeries):
        for k, axis in enumerate("xyz"):
            values, std = 1e3 * series.position_m[:, k], 1e3 * series.std_m[:, k]
            yield Curve(f"{series.name}.place_{axis}", f"{plain} {axis}", "mm", values, std, hint=label)
    angles, stds = np.rad2deg(series.angles_rad()), np.rad2deg(series.angles_std_rad())
    for k, letter in enumerate(angle_labels(series.angle_sequence)):
        panel = f"{stem} {letter}" if side else ""
        name = side or f"{plain} angle {letter}"
        yield Curve(
            f"{series.name}.angle_{letter}", name, "deg", angles[:, k], stds[:, k], panel, side, label
        )
