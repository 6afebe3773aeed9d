"""Opens sources for some seconds and keeps what they deliver, for scans and for the doctor."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from oarlock.live.reading import Packet
from oarlock.live.rig import Source
from oarlock.live.transports import opened
from oarlock.live.transports.transport import Transport
from oarlock.storage.errors import DataError

MOST_BYTES = 32 << 20
"""Of one source; what comes then is counted and not kept."""


@dataclass
class Hearing:
    """What one source has delivered.

    Args:
        source: as a rig file has it.
        packets: in the order of arrival.
        count: of all packets, kept or not.
        kept_bytes: of `packets`.
        problem: why it could not be opened, or ended; empty if all is well.
        state: what its transport says of itself.
    """

    source: Source
    packets: list[Packet] = field(default_factory=list)
    count: int = 0
    kept_bytes: int = 0
    problem: str = ""
    state: str = ""

    def take(self, packet: Packet) -> None:
        """Keep a packet."""
        self.count += 1
        if self.kept_bytes < MOST_BYTES:
            self.packets.append(packet)
            self.kept_bytes += len(packet.data)

    def by_address(self) -> dict[str, list[Packet]]:
        """The packets of each sender."""
        found: dict[str, list[Packet]] = {}
        for packet in self.packets:
            found.setdefault(packet.address, []).append(packet)
        return found


async def hear(sources: Iterable[Source], seconds: float) -> list[Hearing]:
    """Listen to sources at the same time, for so long. What cannot be opened says why in its `problem`."""
    hearings = [Hearing(source) for source in sources]
    tasks = [asyncio.create_task(listen(one)) for one in hearings]
    await pause(seconds)
    await ended(tasks)
    return hearings


async def pause(seconds: float) -> None:
    """The time in which sources are heard."""
    await asyncio.sleep(seconds)


async def listen(hearing: Hearing) -> None:
    """Open a source and keep what it delivers until this is cancelled, or it cannot go on."""
    transport: Transport | None = None
    try:
        transport = opened(hearing.source)
        await transport.run(hearing.take)
    except DataError as error:
        hearing.problem = str(error)
    finally:
        hearing.state = "" if transport is None else transport.state


async def ended(tasks: Sequence[asyncio.Task[None]]) -> None:
    """Stop to listen; what failed in another way than `listen` expects is raised."""
    for task in tasks:
        task.cancel()
    for result in await asyncio.gather(*tasks, return_exceptions=True):
        if isinstance(result, Exception):
            raise result
