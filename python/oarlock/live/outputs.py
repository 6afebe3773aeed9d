"""Estimates for others: as plain data for the page, and as JSON lines by UDP."""

from __future__ import annotations

import json
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.live.picture import LivePicture
    from oarlock.live.session import Estimate

Floats = NDArray[np.float64]
SCHEMA = 1


class Output(Protocol):
    """Gets every estimate as it is made; it must not wait for anybody."""

    def put(self, estimate: Estimate) -> None:
        """Takes an estimate."""


def coordinates_of(estimate: Estimate, model: Model) -> tuple[Floats, Floats]:
    """Mean and standard deviation of each coordinate, rad or m; NaN for one that nothing measures: it is no state."""
    column = {name: k for k, name in enumerate(estimate.belief.state_names)}
    columns = [column.get(name) for name in model.coordinate_names]
    mean, std = estimate.belief.mean, estimate.belief.std
    return _picked(mean, columns), _picked(std, columns)


def _picked(values: Floats, columns: Sequence[int | None]) -> Floats:
    return np.array([np.nan if column is None else values[column] for column in columns])


def joints_of(estimate: Estimate, model: Model) -> dict[str, list[float]]:
    """Coordinate -> value and standard deviation, rad or m; without those that are unknown."""
    rows = zip(model.coordinate_names, *coordinates_of(estimate, model), strict=True)
    return {name: [round(float(m), 5), round(float(s), 5)] for name, m, s in rows if np.isfinite(m + s)}


def frame_of(estimate: Estimate, model: Model, picture: LivePicture | None = None) -> dict[str, Any]:
    """An estimate as the page and the WebSocket have it, docs/live.md.

    Args:
        estimate: of a live session.
        model: of the body.
        picture: adds positions of the figure's points.
    """
    frame: dict[str, Any] = {
        "type": "frame",
        "schema": SCHEMA,
        "time_s": round(estimate.time_s, 4),
        "arrival_s": round(estimate.arrival_s, 4),
        "joints": joints_of(estimate, model),
    }
    if picture is not None:
        frame |= picture.frame(coordinates_of(estimate, model)[0])
    return frame


@dataclass
class UdpLines:
    """Sends each estimate as one line of JSON to a port.

    Args:
        model: of the body.
        host: who gets it.
        port: where.
    """

    model: Model
    host: str
    port: int
    failed: int = 0
    """Estimates that could not be sent."""
    _socket: socket.socket = field(default_factory=lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))

    def put(self, estimate: Estimate) -> None:
        """Sends an estimate, and counts it where it cannot be sent."""
        line = json.dumps(frame_of(estimate, self.model), allow_nan=False) + "\n"
        try:
            self._socket.sendto(line.encode(), (self.host, self.port))
        except OSError:
            self.failed += 1
