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
class WireFormat:
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
    WireFormat("csafe", "csafe", ("ble", "serial"), "CSAFE frames of fitness machines"),
    WireFormat("cycling_power", "cycling_power", ("ble",), "Cycling power measurements (0x2A63)"),
    WireFormat("dot", "dot", ("ble",), "Movella DOT (Xsens DOT): measurement payloads, battery, messages"),
    WireFormat("ftms", "ftms", ("ble",), "Rower data of fitness machines (FTMS, 0x2AD1)"),
    WireFormat("heart_rate", "heart_rate", ("ble",), "Heart rate belts and watches (0x2A37)"),
    WireFormat(
        "lines", "lines", ("serial", "tcp", "udp"), "own lines t_us,seq,ax..mz, or JSON, one object a line"
    ),
    WireFormat(
        "lsl", "lsl", ("lsl",), "Lab Streaming Layer: inertial units by labels and units, other channels"
    ),
    WireFormat("mvn", "mxtp", ("tcp", "udp"), "Xsens MVN network streamer: types 02 and 23"),
    WireFormat("ngimu", "ngimu", ("serial", "udp"), "x-io NGIMU"),
    WireFormat("nmea", "nmea", ("serial", "tcp", "udp"), "GPS receivers: RMC and VTG"),
    WireFormat(
        "open_rowing_monitor", "open_rowing_monitor", ("mqtt", "websocket"), "Open Rowing Monitor, JSON"
    ),
    WireFormat("osc", "osc_readings", ("serial", "udp"), "Open Sound Control, addresses DEVICE/QUANTITY"),
    WireFormat("pm5", "pm5", ("ble",), "Concept2 PM5: status, strokes, force curves"),
    WireFormat("shimmer3", "shimmer3", ("serial",), "Shimmer3 with LogAndStream firmware"),
    WireFormat("vicon", "vicon", ("udp",), "Vicon Tracker: UDP object stream"),
    WireFormat("ximu3", "ximu3", ("serial", "tcp", "udp"), "x-io x-IMU3"),
)

DECODERS: Mapping[str, WireFormat] = MappingProxyType({format.name: format for format in _FORMATS})
"""The formats by name."""
