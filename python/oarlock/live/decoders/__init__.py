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

    def decoder(self, **options: object) -> Decoder:
        """A new decoder, for one device."""
        return cast("Decoder", import_module(f"{__name__}.{self.module}").decoder(**options))


_FORMATS = (
    Format("csafe", "csafe", ("ble", "serial"), "CSAFE frames of fitness machines"),
    Format("cycling_power", "cycling_power", ("ble",), "Cycling power measurements (0x2A63)"),
    Format("ftms", "ftms", ("ble",), "Rower data of fitness machines (FTMS, 0x2AD1)"),
    Format("heart_rate", "heart_rate", ("ble",), "Heart rate belts and watches (0x2A37)"),
    Format("open_rowing_monitor", "open_rowing_monitor", ("mqtt", "websocket"), "Open Rowing Monitor, JSON"),
    Format("pm5", "pm5", ("ble",), "Concept2 PM5: status, strokes, force curves"),
)

DECODERS: Mapping[str, Format] = MappingProxyType({format.name: format for format in _FORMATS})
"""The formats by name."""
