"""The clock of a session and its pauses: this machine's, or another one for simulations that must not wait."""

from __future__ import annotations

import asyncio
from typing import Protocol

from oarlock.live.transports.transport import now_ns


class TimeSource(Protocol):
    """A monotonic clock, and a pause by it."""

    def now_ns(self) -> int:
        """Now, ns, by the clock of arrivals."""

    async def sleep(self, seconds: float) -> None:
        """Returns when so much time has passed."""


class MachineTime:
    """True time."""

    def now_ns(self) -> int:
        """Now, ns, by this machine's monotonic clock."""
        return now_ns()

    async def sleep(self, seconds: float) -> None:
        """Returns when so much time has passed."""
        await asyncio.sleep(seconds)


MACHINE_TIME = MachineTime()
