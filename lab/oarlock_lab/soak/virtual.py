"""A session without waiting: its clock is moved on from packet to packet."""

from __future__ import annotations

import asyncio
import heapq
import itertools
from collections.abc import Iterable, Iterator

from oarlock.live.reading import Packet
from oarlock.live.transports.transport import Deliver
from oarlock_lab.soak.misbehaving import Sent

TURNS = 5
"""Turns of the loop that a task needs to do its work after a pause."""
AT_ONCE = 20
"""Packets between two turns of the loop, so that viewers get their messages."""


class VirtualTime:
    """A clock that stands still until `until` moves it on."""

    def __init__(self, start_ns: int = 10**9) -> None:
        self.time_ns = start_ns
        self._numbers = itertools.count()
        self._sleepers: list[tuple[int, int, asyncio.Future[None]]] = []

    def now_ns(self) -> int:
        """Now, ns."""
        return self.time_ns

    async def sleep(self, seconds: float) -> None:
        """Returns when the clock has been moved on by so much."""
        woken = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self.time_ns + round(1e9 * seconds), next(self._numbers), woken))
        await woken

    async def until(self, time_ns: int) -> None:
        """Moves the clock on; whoever sleeps less long does its work at its own time."""
        while self._sleepers and self._sleepers[0][0] <= time_ns:
            due_ns, _, woken = heapq.heappop(self._sleepers)
            self.time_ns = max(self.time_ns, due_ns)
            if not woken.done():
                woken.set_result(None)
            for _ in range(TURNS):
                await asyncio.sleep(0.0)
        self.time_ns = max(self.time_ns, time_ns)


class VirtualUdp:
    """Delivers datagrams with the time of their arrival as the transport of UDP would.

    Args:
        source: name in the rig.
        time: is moved on from packet to packet.
        packets: in the order of arrival.
    """

    def __init__(self, source: str, time: VirtualTime, packets: Iterable[Sent]) -> None:
        self.source, self.state = source, "virtual"
        self.has_ended = asyncio.Event()
        self._time, self._packets = time, packets

    async def run(self, deliver: Deliver) -> None:
        """Delivers all packets, and waits until it is cancelled."""
        begun_ns = self._time.now_ns()
        for number, packet in enumerate(self._made(begun_ns)):
            await self._time.until(packet.arrival_ns)
            deliver(packet)
            if number % AT_ONCE == 0:
                await asyncio.sleep(0.0)
        await self._time.until(self._time.now_ns() + 2 * 10**9)
        self.has_ended.set()
        await asyncio.Event().wait()

    def _made(self, begun_ns: int) -> Iterator[Packet]:
        last_ns = 0
        for packet in self._packets:
            last_ns = max(last_ns, begun_ns + round(1e9 * packet.due_s))
            yield Packet(
                self.source,
                f"10.0.{packet.sender // 200}.{packet.sender % 200 + 10}:7000",
                "",
                last_ns,
                packet.data,
            )
