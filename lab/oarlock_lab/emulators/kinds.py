"""`KINDS`: the devices that `oarlock lab emulate` can be, one module each, and the rig that receives one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol, cast

from oarlock._core import Model
from oarlock.live.rig import Feed, Rig, Source, streams_of
from oarlock.storage.errors import DataError
from oarlock_lab.emulators.emulated import Emulated

if TYPE_CHECKING:
    from oarlock_lab.emulators.emulated import Destination, DeviceMessage, Wiring


class EmulatorModule(Protocol):
    """What the module of a kind has. One that measures no movement, such as a belt, has only `emulate`."""

    async def emulate(self, emulated: Emulated) -> None:
        """Be the device until the movement ends, or it is cancelled."""

    def messages(self, emulated: Emulated) -> Iterator[DeviceMessage]:
        """All that the devices send, in the order of arrival; without a transport, for tests."""

    def wiring(self, emulated: Emulated) -> Wiring:
        """How a receiver finds the streams."""


@dataclass(frozen=True)
class EmulatorKind:
    """A device.

    Args:
        name: on the command line.
        module: below `oarlock_lab.emulators`.
        transports: that it can use, the usual one first.
        streams: kinds of streams of a recording that it sends; none if it makes its own values.
        rate_hz: at which the real one usually measures.
        port: usual port.
        about: one line for lists and help.
    """

    name: str
    module: str
    transports: tuple[str, ...]
    streams: tuple[str, ...]
    rate_hz: float
    port: int
    about: str

    @property
    def device(self) -> EmulatorModule:
        """Its module.

        Raises:
            DataError: it needs a package that is not installed.
        """
        try:
            return cast("EmulatorModule", import_module(f"oarlock_lab.emulators.{self.module}"))
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] != "bumble":
                raise
            raise DataError(
                f"{self.name} is a Bluetooth device, which needs bumble: pip install 'oarlock-lab[emulate]'"
            ) from error

    def placed(self, place: Destination) -> Destination:
        """A place with what the kind usually has.

        Raises:
            DataError: it has no such transport.
        """
        if place.transport and place.transport not in self.transports:
            known = ", ".join(self.transports)
            raise DataError(f"{self.name} has no transport {place.transport}; expected {known}")
        port = self.port if place.port is None else place.port
        return replace(place, transport=place.transport or self.transports[0], port=port)

    def emulated(self, asked: Emulated) -> Emulated:
        """What is asked with the streams that it sends, and its usual place.

        Raises:
            DataError: the recording has no such stream, or the place is none of its own.
        """
        own = asked.of(*self.streams) if self.streams else asked
        if not own.recording.streams:
            found = ", ".join(sorted({stream.kind for stream in asked.recording.streams}))
            raise DataError(
                f"{self.name} sends streams of the kind {' or '.join(self.streams)}; here are {found}"
            )
        return replace(own, place=self.placed(asked.place))


_ALL = ("imu", "scalar", "vector", "orientation")
_IMU = ("imu",)
_WIRED = ("udp", "tcp", "serial")
_BLE = ("ble",)
_KINDS = (
    EmulatorKind("dot", "dot", _BLE, _IMU, 60.0, 0, "Movella DOT, mode 20"),
    EmulatorKind("ftms", "ftms", _BLE, (), 1.0, 0, "a rowing machine of the Fitness Machine Service"),
    EmulatorKind("heart_rate", "heart_rate", _BLE, (), 1.0, 0, "a heart rate belt"),
    EmulatorKind("lines", "lines", _WIRED, _ALL, 100.0, 9000, "sensors that somebody built: lines of JSON"),
    EmulatorKind("lsl", "lsl", ("lsl",), ("imu", "scalar"), 100.0, 0, "outlets of the Lab Streaming Layer"),
    EmulatorKind(
        "mvn", "mvn", ("udp", "tcp"), ("imu", "orientation"), 60.0, 9763, "Xsens MVN: types 23 and 02"
    ),
    EmulatorKind("ngimu", "ngimu", ("udp", "serial"), _IMU, 50.0, 8000, "x-io NGIMU: OSC"),
    EmulatorKind("nmea", "nmea", _WIRED, (), 10.0, 9000, "a GPS receiver: RMC and VTG"),
    EmulatorKind(
        "open_rowing_monitor",
        "open_rowing_monitor",
        ("websocket",),
        (),
        5.0,
        8080,
        "Open Rowing Monitor: what its page gets",
    ),
    EmulatorKind(
        "open_rowing_monitor_mqtt",
        "open_rowing_monitor",
        ("mqtt",),
        (),
        0.4,
        1883,
        "Open Rowing Monitor: a message a stroke to an MQTT broker",
    ),
    EmulatorKind("osc", "osc", ("udp", "serial"), _ALL, 100.0, 9000, "sensors that somebody built: OSC"),
    EmulatorKind("pm5", "pm5", _BLE, (), 4.0, 0, "Concept2 PM5: status, strokes, force curves"),
    EmulatorKind("shimmer3", "shimmer3", ("serial",), _IMU, 51.2, 0, "Shimmer3, with answers to commands"),
    EmulatorKind("text", "text", _WIRED, _IMU, 100.0, 9000, "units that somebody built: lines t_us,seq,ax.."),
    EmulatorKind("vicon", "vicon", ("udp",), ("vector",), 100.0, 51001, "Vicon Tracker: places of objects"),
    EmulatorKind("ximu3", "ximu3", _WIRED, _IMU, 400.0, 8000, "x-io x-IMU3: binary messages, announcements"),
    EmulatorKind("ximu3_text", "ximu3_text", _WIRED, _IMU, 400.0, 8000, "x-io x-IMU3: messages of text"),
)

KINDS: Mapping[str, EmulatorKind] = MappingProxyType({kind.name: kind for kind in _KINDS})
"""By name."""


LINES = "lines"


def rig_of(kind: EmulatorKind, emulated: Emulated, model: Model, name: str) -> Rig:
    """The rig file's content that receives what a kind sends on this machine.

    Args:
        kind: that emulates.
        emulated: as `EmulatorKind.emulated` gives it.
        model: of the body.
        name: of the model, as a rig file has it.
    """
    wired, known = kind.device.wiring(emulated), streams_of(model)
    sources = {
        own.source: Source(own.source, wired.format, own.transport, own.options, wired.decoder)
        for own in wired.senders.values()
    }
    feeds = []
    for stream in emulated.recording.streams:
        if stream.name not in wired.streams or stream.name not in known:
            continue
        own, (shape, values) = wired.senders[wired.streams[stream.name][0]], known[stream.name]
        carried = tuple(v for v in values if shape != "imu" or v in wired.values)
        rate_hz = round(stream.rate_hz, 3)
        feeds.append(Feed(stream.name, shape, own.source, wired.device(stream.name), carried, rate_hz))
    return Rig(name, None, sources, tuple(feeds))
