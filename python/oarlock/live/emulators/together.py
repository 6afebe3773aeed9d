"""The moment from which emulated units move that are started one after the other."""

from __future__ import annotations

import asyncio


class Together:
    """Units wait for each other, and have one start.

    Args:
        count: of the units.
    """

    def __init__(self, count: int) -> None:
        self._all = asyncio.Barrier(count)
        self._began_s: float | None = None

    async def begun(self) -> float:
        """Waits until all units wait; the start, s by the clock of the event loop, is the same for all."""
        await self._all.wait()
        # A busy machine may pause between two units.
        if self._began_s is None:
            self._began_s = asyncio.get_running_loop().time()
        return self._began_s
