"""A live session: packets in, estimates out.

All that decides an estimate is in the packets, so a recording of them repeats it bit for bit. Commands (track, stop,
note, exchange a unit) are packets of the source `COMMANDS`, so they are recorded in their place.
"""

from __future__ import annotations

import json
import math
from array import array
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import oarlock
from oarlock.live.decoders import DECODERS
from oarlock.live.intake import Intake, Sampled
from oarlock.live.reading import Decoder, Packet
from oarlock.live.rig import Feed, Rig, Source
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Belief, Config, Info, Model, Tracker
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.streams import Stream

COMMANDS = ""
"""Source of the packets that a coach or a program sends: JSON objects with the key `do`."""
MOST_PROBLEMS = 100
_WIDTHS = {"imu": 3, "orientation": 4, "vector": 3}
_VALUE = {"orientation": "quat_wxyz"}


def command(arrival_ns: int, do: str, **keys: object) -> Packet:
    """A command as a packet: `track`, `stop`, `note` with `text`, `assign` with `stream` and `device`."""
    return Packet(COMMANDS, "", "", arrival_ns, json.dumps({"do": do, **keys}).encode())


def live_config(rig: Rig, model: Model) -> Config:
    """The settings of a rig's tracker: a row at the rate of the fastest unit, encoders as sensors like any other."""
    fed = {feed.stream for feed in rig.feeds}
    inputs = [joint.name for joint in model.describe().inputs if joint.name not in fed]
    rate_hz = rig.rate_hz or 0.0
    return oarlock.Config(
        wait_s=rig.wait_s, sample_rate_hz=rate_hz, output_rate_hz=rate_hz, inputs=inputs, stamp_std_s={}
    )


@dataclass(frozen=True, slots=True)
class Estimate:
    """A state estimate of a live tracker.

    Args:
        time_s: of the estimate, s from the session's start.
        arrival_s: when the packet was received that completed it.
        belief: mean and covariance.
        info: report of the update.
    """

    time_s: float
    arrival_s: float
    belief: Belief
    info: Info


@dataclass
class LiveSession:
    """Tracks a rig from packets.

    Args:
        rig: sources, and which device feeds which sensor.
        model: of the body.
        start_ns: the session's start by the clock of arrivals.
        calibration: mounts, biases and lengths; None for the model's.
    """

    rig: Rig
    model: Model
    start_ns: int
    calibration: Calibration | None = None
    config: Config = field(init=False)
    intake: Intake = field(init=False)
    tracker: Tracker | None = field(init=False, default=None)
    from_s: float = field(init=False, default=0.0)
    """The track begins with readings of this time."""
    problems: deque[str] = field(init=False, default_factory=lambda: deque(maxlen=MOST_PROBLEMS))
    """The last commands that could not be carried out, and why."""
    refused: int = field(init=False, default=0)
    """How many could not."""

    def __post_init__(self) -> None:
        self.config = live_config(self.rig, self.model)
        self.intake = Intake(self.rig, self.start_ns, _new_decoder)

    def take(self, packet: Packet) -> list[Estimate]:
        """The estimates that a packet completes."""
        if packet.source == COMMANDS:
            return self._carry_out(packet)
        sampled = self.intake.take(packet)
        return [] if self.tracker is None else self._estimates(sampled)

    def _estimates(self, sampled: Iterable[Sampled]) -> list[Estimate]:
        assert self.tracker is not None
        found = []
        for one in (one for one in sampled if one.time_s >= self.from_s):
            values: Any = one.values
            for belief, info in self.tracker.push(one.stream, one.time_s, values):
                found.append(Estimate(info.time_s, one.arrival_s, belief, info))
        return found

    def _carry_out(self, packet: Packet) -> list[Estimate]:
        try:
            order = json.loads(packet.data)
            do = order["do"]
            if do == "track":
                self.tracker = oarlock.Tracker(self.model, self.calibration, self.config)
                self.from_s = self.intake.seconds(packet.arrival_ns)
            elif do == "stop":
                return self._stop(self.intake.seconds(packet.arrival_ns))
            elif do == "assign":
                self.intake.assign(order["stream"], order["device"])
            elif do != "note":
                raise DataError(f"the command '{do}' is unknown; expected track, stop, assign or note")
        except (ValueError, KeyError, TypeError, DataError) as error:
            self.refused += 1
            self.problems.append(f"{packet.data[:200]!r}: {error}")
        return []

    def _stop(self, arrival_s: float) -> list[Estimate]:
        tracker, self.tracker = self.tracker, None
        done = [] if tracker is None else tracker.flush()
        return [Estimate(info.time_s, arrival_s, belief, info) for belief, info in done]


def recorded(packets: Iterable[Packet], rig: Rig, start_ns: int) -> oarlock.Recording:
    """The readings of the model's sensors in a session's packets, as a recording.

    Raises:
        DataError: no packet has a reading of a sensor.
    """
    intake = Intake(rig, start_ns, _new_decoder)
    rows = {feed.stream: _Rows(feed) for feed in rig.feeds}
    for packet in packets:
        if packet.source == COMMANDS:
            _follow(intake, packet)
            continue
        for one in intake.take(packet):
            rows[one.stream].add(one)
    streams = [own.stream() for own in rows.values() if own.time_s]
    if not streams:
        raise DataError("the packets have no reading of any of the rig's sensors; were its devices on?")
    return oarlock.Recording(streams, {"source": {"format": "live"}})


def _new_decoder(source: Source) -> Decoder:
    if source.format not in DECODERS:
        known = did_you_mean(source.format, sorted(DECODERS))
        raise DataError(f"source '{source.name}': the format {source.format} is unknown. {known}")
    options: Mapping[str, Any] = source.decoder
    return DECODERS[source.format].decoder(source.transport, **options)


def _follow(intake: Intake, packet: Packet) -> None:
    """Carries out what changes which device feeds which stream."""
    try:
        order = json.loads(packet.data)
        if order["do"] == "assign":
            intake.assign(order["stream"], order["device"])
    except (ValueError, KeyError, TypeError):
        return


class _Rows:
    """The readings of one stream, as columns of numbers: hours of them fit into memory."""

    def __init__(self, feed: Feed) -> None:
        self.feed, self.time_s = feed, array("d")
        names = feed.values if feed.kind == "imu" else (_VALUE.get(feed.kind, "value"),)
        self._missing = (math.nan,) * _WIDTHS.get(feed.kind, 1)
        self._columns = {name: array("d") for name in names}

    def add(self, one: Sampled) -> None:
        self.time_s.append(one.time_s)
        values: Any = one.values if isinstance(one.values, Mapping) else {"value": (one.values,)}
        for name, column in self._columns.items():
            column.extend(values.get(name, self._missing))

    def stream(self) -> Stream:
        """The readings by time; of several with the same time the first."""
        time_s, rows = np.unique(np.frombuffer(self.time_s), return_index=True)
        values = {name: self._of(name)[rows] for name in self._columns}
        name = self.feed.stream
        if self.feed.kind == "imu":
            found = {k: column for k, column in values.items() if np.isfinite(column).any()}
            return oarlock.ImuStream(name, time_s, **found)
        if self.feed.kind == "orientation":
            return oarlock.OrientationStream(name, time_s, values["quat_wxyz"])
        if self.feed.kind == "vector":
            return oarlock.VectorStream(name, time_s, values["value"])
        return oarlock.ScalarStream(name, time_s, values["value"][:, 0])

    def _of(self, name: str) -> NDArray[np.float64]:
        return np.frombuffer(self._columns[name]).reshape(-1, len(self._missing))
