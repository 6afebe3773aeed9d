"""What carries bytes: each transport delivers packets as they arrive, and says how it does."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock.live.rig import Source
    from oarlock.live.transports.transport import Transport

TRANSPORTS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "udp": ("Udp", "datagrams to a port of this machine"),
        "tcp": ("Tcp", "a device that serves its data at a port"),
        "ble": ("Ble", "devices of Bluetooth Low Energy"),
        "serial": ("Serial", "a serial line"),
        "lsl": ("Lsl", "a stream of the Lab Streaming Layer"),
        "websocket": ("WebSocket", "messages of a WebSocket server"),
        "mqtt": ("Mqtt", "messages of an MQTT broker"),
        "replay": ("Replay", "a recording, with its true timing"),
    }
)
"""Name in a rig file -> class in the module of that name, and what it is."""


def opened(source: Source) -> Transport:
    """The transport of a source, before it runs.

    Raises:
        DataError: no such transport, an option that it does not have, or a package is missing.
    """
    from oarlock.live.transports.transport import Options

    if source.transport not in TRANSPORTS:
        known = did_you_mean(source.transport, sorted(TRANSPORTS))
        raise DataError(f"source '{source.name}': the transport {source.transport} is unknown. {known}")
    module = import_module(f"{__name__}.{source.transport}")
    made = getattr(module, TRANSPORTS[source.transport][0])
    return cast("Transport", made(source.name, Options(source.name, _asked(source) | dict(source.options))))


def _asked(source: Source) -> dict[str, object]:
    """What a device is asked for: by Bluetooth what its format and decoder need, by serial line to start."""
    if source.transport == "serial" and source.format == "shimmer3":
        from oarlock.live.decoders.shimmer3 import GET_CALIBRATION, GET_INQUIRY, START, STOP

        first = [one.hex() for one in (GET_INQUIRY, GET_CALIBRATION, START)]
        return {"first": first, "last": [STOP.hex()]}
    if source.transport != "ble":
        return {}
    if "mode" in source.options:
        raise DataError(
            f"source '{source.name}': the mode is an option of the decoder, too. Write it once, below "
            f"[sources.{source.name}.decoder]"
        )
    return {
        "profile": source.format,
        **{key: source.decoder[key] for key in ("mode",) if key in source.decoder},
    }
