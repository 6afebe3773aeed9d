"""Datagrams at the ports that devices usually send to, and x-IMU3 units that announce themselves."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace

from oarlock.live.decoders import DECODERS, ximu3_announcement
from oarlock.live.decoders.ximu3_announcement import Announcement
from oarlock.live.reading import Packet
from oarlock.live.rig import Source
from oarlock.live.scan import listening
from oarlock.live.scan.finding import ScanProblem, Sender
from oarlock.live.scan.listening import Hearing
from oarlock.live.scan.recognition import recognised
from oarlock.live.transports.announced import Announcements

USUAL_PORTS = (*range(8000, 8010), *range(9000, 9004), 9763, 51001)
"""x-IMU3 and NGIMU from 8000 on, our lines 9000, MVN 9763, Vicon 51001."""
_SHOWN_BYTES = 24


class Network:
    """Listens to sources of all kinds, and to what x-IMU3 units announce.

    Args:
        sources: what to open.
        connects: whether to connect to the units that announce themselves.
        announcements: whether to listen for these.
    """

    def __init__(
        self, sources: Sequence[Source], *, connects: bool = False, announcements: bool = True
    ) -> None:
        self._connects, self._announcements = connects, announcements
        self._units: dict[str, Announcement] = {}
        self._hearings = [Hearing(source) for source in sources]
        self._tasks: list[asyncio.Task[None]] = []

    async def scan(self, seconds: float) -> tuple[list[Sender], list[ScanProblem]]:
        """What was heard within a time."""
        self._tasks = [asyncio.create_task(listening.listen(hearing)) for hearing in self._hearings]
        problems = await self._announced(seconds)
        await listening.ended(self._tasks)
        by_address = {unit.address: unit for unit in self._units.values()}
        found: list[Sender] = []
        for hearing in self._hearings:
            if hearing.problem:
                problems.append(ScanProblem(_place(hearing.source), hearing.problem.partition(": ")[2]))
            for address, packets in hearing.by_address().items():
                found.append(_finding(hearing.source, address, packets, by_address))
        return [*_once(found), *self._silent(found)], problems

    async def _announced(self, seconds: float) -> list[ScanProblem]:
        if not self._announcements:
            await listening.pause(seconds)
            return []
        try:
            async with Announcements(self._take):
                await listening.pause(seconds)
        except OSError as error:
            await listening.pause(seconds)
            port = ximu3_announcement.PORT
            return [ScanProblem(f"UDP port {port}", f"x-IMU3 units cannot be heard there ({error.strerror})")]
        return []

    def _take(self, unit: Announcement) -> None:
        is_new = unit.serial not in self._units
        self._units[unit.serial] = unit
        if not is_new:
            return
        if self._connects:
            self._open(Source("", "ximu3", "tcp", {"units": [unit.serial]}))
        ports = {h.source.options.get("port") for h in self._hearings if h.source.transport == "udp"}
        if unit.udp_sends_to and unit.udp_sends_to not in ports:
            self._open(Source("", "", "udp", {"port": unit.udp_sends_to}))

    def _open(self, source: Source) -> None:
        hearing = Hearing(source)
        self._hearings.append(hearing)
        self._tasks.append(asyncio.create_task(listening.listen(hearing)))

    def _silent(self, found: Sequence[Sender]) -> list[Sender]:
        """The units that announced themselves and of which nothing was received."""
        heard = {one.address for one in found}
        return [
            _of_unit(unit, Sender("", unit.serial, Source("", "ximu3", "tcp", {"units": [unit.serial]})))
            for unit in self._units.values()
            if unit.serial not in heard
        ]


def _once(found: Sequence[Sender]) -> list[Sender]:
    """Without the connections to units that send datagrams, too: those need none."""
    sending = {one.address for one in found if one.source is not None and one.source.transport == "udp"}
    return [
        one
        for one in found
        if one.source is None or one.source.transport == "udp" or one.address not in sending
    ]


def _place(source: Source) -> str:
    option = {"udp": "port", "tcp": "host", "serial": "device", "replay": "folder"}.get(source.transport, "")
    return f"{source.transport.upper()} {option} {source.options.get(option, '')}".replace("  ", " ").strip()


def _finding(
    source: Source, address: str, packets: Sequence[Packet], units: dict[str, Announcement]
) -> Sender:
    """What a sender is, by what it sent."""
    what = recognised(packets, source)
    if what is None:
        data = packets[0].data
        shown = data[:_SHOWN_BYTES]
        text = shown.decode("ascii") if shown.isascii() and shown.decode().isprintable() else shown.hex(" ")
        more = " ..." if len(data) > _SHOWN_BYTES else ""
        if source.format:
            note = f"the format {source.format} does not read it: {text}{more}. Leave the format out."
        else:
            note = f"no format of Oarlock reads it: {text}{more}"
        return Sender(f"unknown, at {_place(source)}", address, None, note=note)
    note = f"{what.damaged:,} messages could not be decoded" if what.damaged > 1 else ""
    own = replace(source, format=what.format)
    found = Sender(DECODERS[what.format].about, address, own, what.parts, note=note)
    unit = units.get(address.rpartition(":")[0] or address) if what.format == "ximu3" else None
    by_serial = {one.serial: one for one in units.values()}
    if source.transport == "udp" and unit is not None:
        own = replace(own, options={**own.options, "units": [unit.serial]})
        return _of_unit(unit, replace(found, address=unit.serial, source=own))
    return _of_unit(by_serial[address], found) if address in by_serial else found


def _of_unit(unit: Announcement, found: Sender) -> Sender:
    signal = "is the access point" if unit.rssi_percent < 0 else f"{unit.rssi_percent:.0f} %"
    return replace(
        found,
        what=f'x-IMU3 "{unit.name}" at {unit.address}, TCP port {unit.tcp_port}',
        battery_percent=unit.battery_percent,
        signal=signal,
        name=unit.name,
    )
