"""Devices that advertise by Bluetooth Low Energy."""

from __future__ import annotations

from oarlock.live.decoders import DECODERS
from oarlock.live.rig import Source
from oarlock.live.scan.finding import ScanProblem, Sender
from oarlock.live.transports import ble
from oarlock.live.transports.ble_profiles import kind_of
from oarlock.live.transports.radio import BleAdvertisement, RadioError
from oarlock.storage.errors import DataError


async def advertised(seconds: float) -> tuple[list[Sender], list[Sender], list[ScanProblem]]:
    """Devices of known kinds, all others, and why Bluetooth could not be searched."""
    try:
        found = await ble.own_radio().scan(seconds)
    except (DataError, RadioError, TimeoutError) as error:
        return [], [], [ScanProblem("Bluetooth", str(error) or "the adapter does not answer")]
    known = [_known(one, kind) for one in found if (kind := kind_of(one.name, one.services))]
    others = [
        Sender(one.name or "without a name", one.address, None, signal=_signal(one))
        for one in found
        if not kind_of(one.name, one.services)
    ]
    return known, others, []


def _known(one: BleAdvertisement, kind: str) -> Sender:
    source = Source("", kind, "ble", {"addresses": [one.address]})
    name = f' "{one.name}"' if one.name else ""
    about = DECODERS[kind].about.partition(":")[0]
    return Sender(f"{about}{name}", one.address, source, signal=_signal(one), name=one.name)


def _signal(one: BleAdvertisement) -> str:
    return f"{one.rssi_dbm:.0f} dBm"
