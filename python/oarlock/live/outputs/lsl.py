"""Two streams of the Lab Streaming Layer: joint angles with standard deviations, and what happens as markers."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.live.named_angles import LiveAngles, joints_with_names
from oarlock.live.outputs.output import SessionStart
from oarlock.live.transports.transport import now_ns
from oarlock.model.coordinates import parts
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

Channel = tuple[str, str, str]
"""Label, unit and type of a channel."""


@dataclass
class LslStreams:
    """An outlet `STREAM` of joint angles, and an outlet `STREAM events` of events and repetitions as JSON texts.

    Samples have the stamp of the moment of the estimate in LSL's clock, not that of sending.

    Args:
        stream: name of the streams.
        model: of the body.
        rate_hz: of the estimates; None if unknown.

    Raises:
        DataError: pylsl or its library is missing.
    """

    stream: str
    model: Model
    rate_hz: float | None
    name: str = field(init=False)

    def __post_init__(self) -> None:
        self.name = f'LSL streams "{self.stream}"'
        self._rows = list(_rows(self.model))
        self._from_start_s = 0.0
        try:
            self._lsl: Any = import_module("pylsl")
        except (ImportError, RuntimeError) as error:
            raise DataError(
                f"LSL needs pylsl with its library: pip install 'oarlock[lsl]' ({error})"
            ) from error

    def open(self, start: SessionStart) -> None:
        """Announces both streams."""
        lsl = self._lsl
        # On Linux both clocks are the same; elsewhere they have different zeros.
        self._from_start_s = lsl.local_clock() - (now_ns() - start.monotonic_ns) / 1e9
        rate_hz = self.rate_hz or lsl.IRREGULAR_RATE
        channels = list(channels_of(self.model))
        info = self._info(self.stream, "MoCap", len(channels), rate_hz, lsl.cf_float32)
        described = info.desc().append_child("channels")
        for label, unit, kind in channels:
            channel = described.append_child("channel")
            for key, value in (("label", label), ("unit", unit), ("type", kind)):
                channel.append_child_value(key, value)
        try:
            self._angles = lsl.StreamOutlet(info)
            self._events = lsl.StreamOutlet(
                self._info(f"{self.stream} events", "Markers", 1, lsl.IRREGULAR_RATE, lsl.cf_string)
            )
        except RuntimeError as error:
            raise OSError(f"liblsl opens no outlet: {error}") from error

    def send(self, message: Mapping[str, Any]) -> None:
        """Pushes a message; liblsl sends it from threads of its own."""
        stamp_s = self._from_start_s + message["time_s"]
        if message["type"] != "frame":
            self._events.push_sample([json.dumps(message, allow_nan=False)], stamp_s)
            return
        unknown = (np.nan, np.nan)
        row = [message[part].get(name, unknown) for part, name in self._rows]
        self._angles.push_sample([pair[0] for pair in row] + [pair[1] for pair in row], stamp_s)

    def close(self) -> None:
        """Ends both streams."""
        self._angles = self._events = None

    def _info(self, name: str, kind: str, count: int, rate_hz: float, form: int) -> Any:
        # With a lasting source_id an inlet finds the stream again after a restart of the session.
        source_id = f"oarlock {name} {socket.gethostname()}"
        info = self._lsl.StreamInfo(name, kind, count, rate_hz, form, source_id)
        info.desc().append_child_value("manufacturer", "Oarlock").append_child_value("model", self.model.name)
        return info


def channels_of(model: Model) -> Iterator[Channel]:
    """Label, unit and type of each channel of the angles' stream: all values, then all standard deviations."""
    units = dict.fromkeys(model.coordinate_names, "rad") | dict.fromkeys(_lengths(model), "m")
    for _, name in _rows(model):
        unit = units.get(name, "rad")
        yield name, unit, "Position" if unit == "m" else "Angle"
    for _, name in _rows(model):
        yield f"{name}_std", units.get(name, "rad"), "StandardDeviation"


def _rows(model: Model) -> Iterator[tuple[str, str]]:
    """Key of a frame, and name within it, of each channel of values."""
    for name in model.coordinate_names:
        yield "joints", name
    if joints_with_names(model):
        for name in LiveAngles(model).names:
            yield "angles", name


def _lengths(model: Model) -> Iterator[str]:
    slides = {joint.name for joint in model.describe().joints if joint.kind == "slide"}
    for part in parts(model.coordinate_names):
        if part.kind == "position" or part.joint in slides:
            yield from (model.coordinate_names[column] for column in part.columns)
