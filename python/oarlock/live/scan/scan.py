"""Looks everywhere at the same time: networks, Bluetooth, LSL and serial ports."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass

from oarlock.live.rig import Source
from oarlock.live.scan.bluetooth import advertised
from oarlock.live.scan.finding import Scan, ScanProblem, Sender
from oarlock.live.scan.lsl_streams import streams
from oarlock.live.scan.network import USUAL_PORTS, Network
from oarlock.live.scan.serial_ports import ports

PLACES = ("network", "ble", "lsl", "serial")


@dataclass(frozen=True)
class ScanRequest:
    """Where to look.

    Args:
        seconds: how long.
        places: some of `PLACES`.
        sources: to be opened, too; a format that is empty is found.
        connects: connect to x-IMU3 units that announce themselves, to see what they send.
    """

    seconds: float = 5.0
    places: Sequence[str] = PLACES
    sources: Sequence[Source] = ()
    connects: bool = False


async def scan(asked: ScanRequest) -> Scan:
    """All that is found within the time."""
    network, bluetooth, lsl = await asyncio.gather(_network(asked), _bluetooth(asked), _lsl(asked))
    opened = frozenset(str(source.options.get("device", "")) for source in asked.sources)
    lines = ports(opened) if "serial" in asked.places else ([], [])
    findings = (*network[0], *bluetooth[0], *lsl[0], *lines[0])
    return Scan(
        asked.seconds, findings, (*network[1], *bluetooth[2], *lsl[1], *lines[1]), tuple(bluetooth[1])
    )


Found = tuple[list[Sender], list[ScanProblem]]


async def _network(asked: ScanRequest) -> Found:
    is_asked = "network" in asked.places
    own = {source.options.get("port") for source in asked.sources if source.transport == "udp"}
    usual = [Source("", "", "udp", {"port": port}) for port in USUAL_PORTS if is_asked and port not in own]
    network = Network([*asked.sources, *usual], connects=asked.connects, announcements=is_asked)
    return await network.scan(asked.seconds)


async def _bluetooth(asked: ScanRequest) -> tuple[list[Sender], list[Sender], list[ScanProblem]]:
    return await advertised(asked.seconds) if "ble" in asked.places else ([], [], [])


async def _lsl(asked: ScanRequest) -> Found:
    """In a thread, because liblsl waits."""
    return await asyncio.to_thread(streams, asked.seconds) if "lsl" in asked.places else ([], [])
