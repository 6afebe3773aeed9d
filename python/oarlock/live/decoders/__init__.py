"""`DECODERS`: the wire formats that a rig file may name, one module each. None needs a further package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from oarlock.live.reading import Decoder


@dataclass(frozen=True)
class Format:
    """A wire format.

    Args:
        name: in the rig file.
        module: below `oarlock.live.decoders`; its `decoder(**options)` makes a decoder of one device.
        transports: what carries it: `ble`, `lsl`, `mqtt`, `serial`, `tcp`, `udp`, `websocket`.
        about: one line for lists and help.
    """

    name: str
    module: str
    transports: tuple[str, ...]
    about: str

    def options_over(self, transport: str) -> Mapping[str, object]:
        """Options of its decoder that follow from the transport: over `udp` each packet has whole messages."""
        return {"datagrams": True} if transport == "udp" and len(self.transports) > 1 else {}

    def decoder(self, **options: object) -> Decoder:
        """A new decoder, for one device."""
        return cast("Decoder", import_module(f"{__name__}.{self.module}").decoder(**options))


_FORMATS = (
    Format("dot", "dot", ("ble",), "Movella DOT (Xsens DOT): measurement payloads, battery, messages"),
    Format(
        "lines", "lines", ("serial", "tcp", "udp"), "own lines t_us,seq,ax..mz, or JSON, one object a line"
    ),
    Format("mvn", "mxtp", ("tcp", "udp"), "Xsens MVN network streamer: types 02 and 23"),
    Format("ngimu", "ngimu", ("serial", "udp"), "x-io NGIMU"),
    Format("nmea", "nmea", ("serial", "tcp", "udp"), "GPS receivers: RMC and VTG"),
    Format("osc", "osc_readings", ("serial", "udp"), "Open Sound Control, addresses DEVICE/QUANTITY"),
    Format("shimmer3", "shimmer3", ("serial",), "Shimmer3 with LogAndStream firmware"),
    Format("vicon", "vicon", ("udp",), "Vicon Tracker: UDP object stream"),
    Format("ximu3", "ximu3", ("serial", "tcp", "udp"), "x-io x-IMU3"),
)

DECODERS: Mapping[str, Format] = MappingProxyType({format.name: format for format in _FORMATS})
"""The formats by name."""
