"""A connection to a device that serves its data at a port, as an x-IMU3 or MVN does."""

from __future__ import annotations

import asyncio

from oarlock.live.reading import Packet
from oarlock.live.transports.transport import Deliver, Options, again_and_again, now_ns

READ_BYTES = 1 << 16


class Tcp:
    """Connects to a device, and again when it is lost. Options: `host` and `port` of the device."""

    def __init__(self, source: str, options: Options) -> None:
        options.check("host", "port")
        self.source, self.host, self.port = source, options.text("host"), options.port()
        self.state = "not started"

    async def run(self, deliver: Deliver) -> None:
        """Delivers what arrives together as a packet until it is cancelled."""
        place = f"{self.host}:{self.port}"

        async def connected() -> None:
            reader, writer = await asyncio.open_connection(self.host, self.port)
            self.state = f"connected to {place}"
            try:
                while data := await reader.read(READ_BYTES):
                    deliver(Packet(self.source, place, "", now_ns(), data))
            finally:
                writer.close()

        await again_and_again(self, connected, place)
