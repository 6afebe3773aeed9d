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

    def decoder(self, transport: str = "", **options: object) -> Decoder:
        """A new decoder, for one device.

        Args:
            transport: what carries its bytes; over `udp` each packet has whole messages.
            options: of the format, by the names of its module's `decoder`.
        """
        if transport == "udp" and len(self.transports) > 1:
            options = {"datagrams": True, **options}
        return cast("Decoder", import_module(f"{__name__}.{self.module}").decoder(**options))


_FORMATS = (
    Format("csafe", "csafe", ("ble", "serial"), "CSAFE frames of fitness machines"),
    Format("cycling_power", "cycling_power", ("ble",), "Cycling power measurements (0x2A63)"),
    Format("dot", "dot", ("ble",), "Movella DOT (Xsens DOT): measurement payloads, battery, messages"),
    Format("ftms", "ftms", ("ble",), "Rower data of fitness machines (FTMS, 0x2AD1)"),
    Format("heart_rate", "heart_rate", ("ble",), "Heart rate belts and watches (0x2A37)"),
    Format(
        "lines", "lines", ("serial", "tcp", "udp"), "own lines t_us,seq,ax..mz, or JSON, one object a line"
    ),
    Format("lsl", "lsl", ("lsl",), "Lab Streaming Layer: inertial units by labels and units, other channels"),
    Format("mvn", "mxtp", ("tcp", "udp"), "Xsens MVN network streamer: types 02 and 23"),
    Format("ngimu", "ngimu", ("serial", "udp"), "x-io NGIMU"),
    Format("nmea", "nmea", ("serial", "tcp", "udp"), "GPS receivers: RMC and VTG"),
    Format("open_rowing_monitor", "open_rowing_monitor", ("mqtt", "websocket"), "Open Rowing Monitor, JSON"),
    Format("osc", "osc_readings", ("serial", "udp"), "Open Sound Control, addresses DEVICE/QUANTITY"),
    Format("pm5", "pm5", ("ble",), "Concept2 PM5: status, strokes, force curves"),
    Format("shimmer3", "shimmer3", ("serial",), "Shimmer3 with LogAndStream firmware"),
    Format("vicon", "vicon", ("udp",), "Vicon Tracker: UDP object stream"),
    Format("ximu3", "ximu3", ("serial", "tcp", "udp"), "x-io x-IMU3"),
)

DECODERS: Mapping[str, Format] = MappingProxyType({format.name: format for format in _FORMATS})
"""The formats by name."""
