"""The packets of an earlier session again, with their true timing: gaps, bursts and damaged bytes included."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

from oarlock.live.recorder import read_packets
from oarlock.live.transports.transport import Deliver, Options, now_ns


class Replay:
    """Delivers the packets of one source of a session's folder. Options: `folder`; `of`, the source's name there.

    `of` is this source's name if it is not given. It ends in silence when the packets do.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check("folder", "of")
        self.source, self.of = source, options.text("of", source)
        self.packets = Path(options.text("folder")) / "packets"
        self.state = "not started"

    async def run(self, deliver: Deliver) -> None:
        """Delivers each packet as long after the first as it came then, and waits until it is cancelled."""
        begun_ns, first_ns = now_ns(), None
        self.state = f"replays {self.packets}"
        for packet in read_packets(self.packets):
            first_ns = packet.arrival_ns if first_ns is None else first_ns
            if packet.source != self.of:
                continue
            due_ns = begun_ns + packet.arrival_ns - first_ns
            while (early_ns := due_ns - now_ns()) > 0:
                await asyncio.sleep(early_ns / 1e9)
            deliver(replace(packet, source=self.source, arrival_ns=due_ns))
        self.state = f"has replayed {self.packets}"
        await asyncio.Event().wait()
