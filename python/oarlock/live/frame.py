"""Estimates as plain data: frames of the page, of the WebSocket and of all other outputs; docs/live.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.live.named_angles import LiveAngles
    from oarlock.live.picture import LivePicture
    from oarlock.live.session import Estimate

SCHEMA = 1


def coordinates_of(estimate: Estimate, model: Model) -> tuple[Floats, Floats]:
    """Mean and standard deviation of each coordinate, rad or m; NaN for one that nothing measures: it is no state."""
    column = {name: k for k, name in enumerate(estimate.belief.state_names)}
    columns = [column.get(name) for name in model.coordinate_names]
    mean, std = estimate.belief.mean, estimate.belief.std
    return _picked(mean, columns), _picked(std, columns)


def frame_of(
    estimate: Estimate, model: Model, picture: LivePicture | None = None, named: LiveAngles | None = None
) -> dict[str, Any]:
    """An estimate as the page and the other outputs have it, docs/live.md.

    Args:
        estimate: of a live session.
        model: of the body.
        picture: adds positions of the figure's points.
        named: adds the angles of ball joints; it follows them from frame to frame.
    """
    mean, std = coordinates_of(estimate, model)
    frame: dict[str, Any] = {
        "type": "frame",
        "schema": SCHEMA,
        "time_s": round(estimate.time_s, 4),
        "arrival_s": round(estimate.arrival_s, 4),
        "joints": _known(model.coordinate_names, mean, std),
    }
    if named is not None:
        frame["angles"] = _known(named.names, *named.of(mean, std))
    if picture is not None:
        frame |= picture.frame(mean)
    return frame


def _picked(values: Floats, columns: Sequence[int | None]) -> Floats:
    return np.array([np.nan if column is None else values[column] for column in columns])


def _known(names: Sequence[str], values: Floats, stds: Floats) -> dict[str, list[float]]:
    """Name -> value and standard deviation, rad or m; without those that are unknown."""
    rows = zip(names, values.tolist(), stds.tolist(), strict=True)
    return {name: [round(m, 5), round(s, 5)] for name, m, s in rows if np.isfinite(m + s)}
