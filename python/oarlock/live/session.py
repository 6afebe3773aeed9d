"""A live session: packets in, estimates out.

All that decides an estimate is in the packets, so a recording of them repeats it bit for bit. Commands (track, stop,
note, exchange a unit) are packets of the source `COMMANDS`, so they are recorded in their place.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import oarlock
from oarlock.formats.arbitrary_units import SCALE_KEY
from oarlock.live.decoders import DECODERS
from oarlock.live.intake import Intake, SensorReading, Spare
from oarlock.live.reading import Decoder, Packet
from oarlock.live.rig import Rig, Source
from oarlock.live.rows import StreamBuffer
from oarlock.recording.calibration import parsed_calibration
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.storage.errors import DataError, DivergedError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Belief, Config, Info, Model, Tracker
    from oarlock.recording.calibration import Calibration

COMMANDS = ""
"""Source of the packets that a coach or a program sends: JSON objects with the key `do`."""
MOST_PROBLEMS = 100


_NUMBER = (int, float)
ORDERS: Mapping[str, Mapping[str, type | tuple[type, ...]]] = {
    "track": {},
    "stop": {},
    "note": {"text": str, "time_s": (*_NUMBER, type(None))},
    "assign": {"stream": str, "device": str},
    "step": {"name": str, "begin_s": (*_NUMBER, type(None)), "end_s": (*_NUMBER, type(None))},
    "calibrate": {"toml": str},
    "clock": {"stream": str, "late_s": _NUMBER, "std_s": _NUMBER},
}
"""What a session can be told, with its keys and their types; a key that may be null may be absent."""


def order_of(command: bytes | Mapping[str, Any]) -> dict[str, Any]:
    """A command as an object with the key `do`, checked before it is recorded and whenever it is read.

    Raises:
        DataError: it is no such object, or a key is unknown, absent or of another type.
    """
    try:
        order: Any = json.loads(command) if isinstance(command, bytes) else command
    except (ValueError, RecursionError) as error:
        raise DataError(f"not JSON ({error})") from error
    do = order.get("do") if isinstance(order, Mapping) else None
    if not isinstance(do, str) or do not in ORDERS:
        raise DataError(f"the command {str(do)[:40]!r} is unknown; expected {', '.join(ORDERS)}")
    keys = ORDERS[do]
    unknown = [str(name) for name in order if name != "do" and name not in keys]
    if unknown:
        raise DataError(
            f"the command '{do}' has no key {unknown[0][:40]!r}; it has {', '.join(keys) or 'none'}"
        )
    for name, types in keys.items():
        value = order.get(name)
        if not isinstance(value, types) or isinstance(value, bool):
            expected = "a text" if types is str else "a number"
            raise DataError(f"the command '{do}' needs {expected} as '{name}', and has {str(value)[:40]!r}")
        if isinstance(value, _NUMBER) and not math.isfinite(value):
            raise DataError(f"the command '{do}' needs a finite number as '{name}', and has {value}")
        if isinstance(value, str) and not _is_text(value):
            raise DataError(f"the command '{do}' has characters as '{name}' that are no text")
    return dict(order)


def _is_text(value: str) -> bool:
    """Whether a file can have it: half a surrogate pair is no character."""
    return not any("\ud800" <= character <= "\udfff" for character in value)


def command(arrival_ns: int, do: str, **keys: object) -> Packet:
    """A command as a packet.

    It is `track`, `stop`, `note` with `text`, or `assign` with `stream` and `device`. A guided start adds `step` with
    `name`, `begin_s` and `end_s` (null: the step does not count), and `calibrate` with `toml`, the text of a
    calibration file, which serves all tracking from then on. A session gives itself `clock` with `stream`, `late_s`
    and `std_s`: by how much its device's clock is late.
    """
    return Packet(COMMANDS, "", "", arrival_ns, json.dumps({"do": do, **keys}).encode())


def live_config(rig: Rig, model: Model, stamp_std_s: Mapping[str, float] | None = None) -> Config:
    """The settings of a rig's tracker: a row at the rate of the fastest unit, encoders as sensors like any other.

    Args:
        rig: which sensors there are.
        model: of the body.
        stamp_std_s: standard deviations of time stamps by stream.
    """
    fed = {feed.stream for feed in rig.feeds}
    inputs = [joint.name for joint in model.describe().inputs if joint.name not in fed]
    rate_hz = rig.rate_hz or 0.0
    return oarlock.Config(
        wait_s=rig.wait_s,
        sample_rate_hz=rate_hz,
        output_rate_hz=rate_hz,
        inputs=inputs,
        stamp_std_s=dict(stamp_std_s or {}),
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
    divergence: str = field(init=False, default="")
    """Why the filter lost the track, until tracking begins again or is stopped."""
    listeners: list[Callable[[list[SensorReading]], None]] = field(init=False, default_factory=list)
    """Get all readings, too; they decide no estimate."""

    def __post_init__(self) -> None:
        self.config = live_config(self.rig, self.model)
        self.intake = Intake(self.rig, self.start_ns, _new_decoder)

    def take(self, packet: Packet) -> list[Estimate]:
        """The estimates that a packet completes."""
        if packet.source == COMMANDS:
            return self._carry_out(packet)
        sampled = self.intake.take(packet)
        for listener in self.listeners:
            listener(sampled)
        return [] if self.tracker is None else self._estimates(sampled)

    def _estimates(self, sampled: Iterable[SensorReading]) -> list[Estimate]:
        found = []
        try:
            for one in (one for one in sampled if one.time_s >= self.from_s):
                values: Any = one.values
                assert self.tracker is not None
                for belief, info in self.tracker.push(one.stream, one.time_s, values):
                    found.append(Estimate(info.time_s, one.arrival_s, belief, info))
        except DivergedError as error:
            self.tracker, self.divergence = None, str(error)
        return found

    def _carry_out(self, packet: Packet) -> list[Estimate]:
        try:
            order = order_of(packet.data)
            do = order["do"]
            self.divergence = "" if do in ("track", "stop") else self.divergence
            if do == "track":
                self.config = live_config(self.rig, self.model, self.intake.stamp_stds())
                self.tracker = oarlock.Tracker(self.model, self.calibration, self.config)
                self.from_s = self.intake.seconds(packet.arrival_ns)
            elif do == "stop":
                return self._stop(self.intake.seconds(packet.arrival_ns))
            elif do == "assign":
                self.intake.assign(order["stream"], order["device"])
            elif do == "calibrate":
                self.calibration = parsed_calibration(order["toml"])
            elif do == "clock":
                self.intake.tie(order["stream"], float(order["late_s"]), float(order["std_s"]))
        except DataError as error:
            self.refused += 1
            self.problems.append(f"{packet.data[:200]!r}: {error}")
        return []

    def _stop(self, arrival_s: float) -> list[Estimate]:
        held = self.intake.flush()
        found = [] if self.tracker is None else self._estimates(held)
        tracker, self.tracker, self.divergence = self.tracker, None, ""
        if tracker is not None:
            with suppress(DivergedError):
                found += [Estimate(info.time_s, arrival_s, belief, info) for belief, info in tracker.flush()]
        return found


def recorded(
    packets: Iterable[Packet],
    rig: Rig,
    start_ns: int,
    keep: Callable[[Spare], None] = lambda spare: None,
    epoch: str | None = None,
    refuse: Callable[[DataError], None] = lambda error: None,
) -> oarlock.Recording:
    """The readings of the model's sensors in a session's packets, as a recording.

    Args:
        packets: in the order of arrival.
        rig: which device feeds which stream.
        start_ns: the session's start by the clock of arrivals.
        keep: gets what feeds no sensor.
        epoch: the moment of the start as ISO text; None if it is not known.
        refuse: gets why a command of the last packet cannot be carried out; it was refused when it came, too.

    Raises:
        DataError: no packet has a reading of a sensor.
    """
    intake, rows = Intake(rig, start_ns, _new_decoder, keep), StreamBuffer(rig)
    rows.add(_all_sampled(packets, intake, refuse))
    clock = {CLOCK_KEY: {"kind": "utc", "zero": epoch}} if epoch else {}
    return rows.recording({**_mag_scales(intake), **clock})


def _new_decoder(source: Source) -> Decoder:
    if source.format not in DECODERS:
        known = did_you_mean(source.format, sorted(DECODERS))
        raise DataError(f"source '{source.name}': the format {source.format} is unknown. {known}")
    options: Mapping[str, Any] = source.decoder
    return DECODERS[source.format].decoder(source.transport, **options)


def _mag_scales(intake: Intake) -> Mapping[str, object]:
    """The entry of `Recording.meta` for magnetometers in arbitrary units."""
    known = {name: one.unit_ut for name, one in intake.mag_units.items() if one.unit_ut is not None}
    return {SCALE_KEY: known} if known else {}


def _all_sampled(
    packets: Iterable[Packet], intake: Intake, refuse: Callable[[DataError], None]
) -> Iterator[SensorReading]:
    for packet in packets:
        if packet.source != COMMANDS:
            yield from intake.take(packet)
            continue
        try:
            yield from _follow(intake, packet)
        except DataError as error:
            refuse(error)
    yield from intake.flush()


def _follow(intake: Intake, packet: Packet) -> list[SensorReading]:
    """Carries out what changes which readings there are."""
    order = order_of(packet.data)
    if order["do"] == "stop":
        return intake.flush()
    if order["do"] == "assign":
        intake.assign(order["stream"], order["device"])
    if order["do"] == "clock":
        intake.tie(order["stream"], float(order["late_s"]), float(order["std_s"]))
    if order["do"] == "calibrate":
        parsed_calibration(order["toml"])
    return []
