"""Estimates for others: as plain data for the page, and as JSON lines by UDP."""

from __future__ import annotations

import json
import socket
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.live.picture import LivePicture
    from oarlock.live.session import Estimate

SCHEMA = 1


class Output(Protocol):
    """Gets every estimate as it is made; it must not wait for anybody."""

    def put(self, estimate: Estimate) -> None:
        """Takes an estimate."""


def joints_of(estimate: Estimate, model: Model) -> dict[str, list[float]]:
    """Coordinate -> value and standard deviation, rad or m."""
    names = model.coordinate_names
    mean, std = estimate.belief.mean[: len(names)], estimate.belief.std[: len(names)]
    return {
        name: [round(float(m), 5), round(float(s), 5)] for name, m, s in zip(names, mean, std, strict=True)
    }


def frame_of(estimate: Estimate, model: Model, picture: LivePicture | None = None) -> dict[str, Any]:
    """An estimate as the page and the WebSocket have it, docs/live.md.

    Args:
        estimate: of a live session whose encoders are sensors: its first states are the coordinates.
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
        frame |= picture.frame(np.asarray(estimate.belief.mean[: len(model.coordinate_names)]))
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
