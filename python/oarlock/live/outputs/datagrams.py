"""Messages as UDP datagrams: lines of JSON, and bundles of OSC."""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from oarlock.live.decoders.osc import UNIX_EPOCH_S, bundle, message
from oarlock.live.outputs.output import SessionStart

Encoder = Callable[[Mapping[str, Any], SessionStart], bytes]
ROOT = "/oarlock"
_NOT_IN_ADDRESSES = re.compile(r"[^\x21-\x7e]|[#*,/?\[\]{}]")
"""OSC 1.0 forbids these in the parts of an address."""


@dataclass
class Datagrams:
    """Sends each message as a datagram.

    Args:
        name: for people.
        host, port: where to.
        encoder: makes the datagram.
    """

    name: str
    host: str
    port: int
    encoder: Encoder
    _socket: socket.socket | None = field(init=False, default=None)
    _start: SessionStart = field(init=False, default=SessionStart(0, 0.0))

    def open(self, start: SessionStart) -> None:
        """Finds the host."""
        kind, _, _, _, address = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_DGRAM)[0]
        self._start = start
        self._socket = socket.socket(kind, socket.SOCK_DGRAM)
        # A connected socket learns that nobody listens at a port of this machine.
        self._socket.connect(address)

    def send(self, message: Mapping[str, Any]) -> None:
        """Sends a message."""
        if self._socket is not None:
            self._socket.send(self.encoder(message, self._start))

    def close(self) -> None:
        """Closes the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def json_line(message: Mapping[str, Any], start: SessionStart) -> bytes:
    """A message as one line of JSON."""
    return json.dumps(message, allow_nan=False).encode() + b"\n"


def osc_bundle(told: Mapping[str, Any], start: SessionStart) -> bytes:
    """A message as an OSC bundle; its time tag is the moment that the message is about, UTC."""
    tag = round((start.epoch_s + told["time_s"] + UNIX_EPOCH_S) * 2.0**20) << 12
    # the seconds of time tags begin at 0 again in 2036
    tag %= 1 << 64
    return bundle(tag, [message(f"{ROOT}/{address}", values) for address, values in _osc_messages(told)])


def _osc_messages(told: Mapping[str, Any]) -> list[tuple[str, list[float | str]]]:
    time_s: tuple[str, list[float | str]] = ("time", [told["time_s"]])
    if told["type"] == "event":
        return [time_s, ("event", [told["text"]])]
    if told["type"] != "frame":
        kind = _part(told["type"])
        values = [(f"{kind}/{_part(key)}", [one["value"], one["std"]]) for key, one in told["values"].items()]
        return [time_s, (f"{kind}/number", [told["number"]]), *values]
    joints = [(f"joint/{_part(name)}", list(pair)) for name, pair in told["joints"].items()]
    angles = [(f"angle/{_part(name)}", list(pair)) for name, pair in told.get("angles", {}).items()]
    return [time_s, *joints, *angles]


def _part(name: str) -> str:
    return _NOT_IN_ADDRESSES.sub("_", name)
