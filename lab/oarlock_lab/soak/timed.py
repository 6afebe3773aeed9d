"""A live session in a process of its own that notes when each estimate came out, and its sender.

`python -m oarlock_lab.soak.timed FOLDER PORT` runs until SIGINT; with `--send PORT` alone it sends five
units and five encoders at 100 Hz, without losses.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from oarlock import load_model
from oarlock.live.live import Live
from oarlock.live.outputs.output import SessionStart
from oarlock.live.session import Estimate
from oarlock.live.simulated_devices import Faults, send
from oarlock.live.transports.udp import Udp
from oarlock.rowing.simulation.emulated import RATE_HZ, rowing_devices
from oarlock_lab.soak.child import FIGURES, made, run

FAULTS = Faults(drift_ppm=40.0, least_ms=2.0, jitter_ms=4.0)
"""Clocks that drift and Wi-Fi that queues; nothing is lost, so a loss is the session's."""


@dataclass
class Timed:
    """An output of a session that notes times.

    Args:
        live: the session.
    """

    live: Live
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Of each estimate: its moment, when the packet came that completed it, when it came out, and what time the session
    had the processor until then, s."""

    name: str = "times"
    problem: str = ""

    @property
    def path(self) -> Timed:
        """It is its own way out."""
        return self

    def start(self, start: SessionStart) -> None:
        """Nothing to open."""

    def put(self, estimate: Estimate) -> None:
        """Takes an estimate as soon as it is there."""
        self.rows.append(
            (round(estimate.time_s, 4), estimate.arrival_s, self.live.seconds, time.process_time())
        )

    def tell(self, message: Any) -> None:
        """Events are not timed."""

    def close(self) -> None:
        """Nothing to close."""

    def health(self) -> dict[str, Any]:
        """As the page gets it."""
        return {"name": "times", "problem": "", "sent": len(self.rows), "skipped": 0}


def figures(live: Live, timed: Timed, dropped: int) -> dict[str, Any]:
    """What a session found: times, and readings that were lost."""
    devices = live.session.intake.devices.values()
    return {
        "rows": timed.rows,
        "readings": sum(device.readings for device in devices),
        "lost": sum(device.lost for device in devices),
        "dropped": dropped,
    }


async def _session(folder: Path, port: int) -> dict[str, Any]:
    live = made(load_model("sculler"), folder, RATE_HZ, port)
    timed = Timed(live)
    live.outputs = (timed,)  # type: ignore[assignment]
    dropped = 0

    async def count() -> None:
        """The kernel counts as long as the socket is open."""
        nonlocal dropped
        while True:
            await asyncio.sleep(0.5)
            now = sum(t.dropped or 0 for t in live.transports.values() if isinstance(t, Udp))
            dropped = max(dropped, now)

    counting = asyncio.ensure_future(count())
    await run(live)
    counting.cancel()
    return figures(live, timed, dropped)


def main() -> None:
    """Reads the command line."""
    command = argparse.ArgumentParser(prog="python -m oarlock_lab.soak.timed", description=__doc__)
    command.add_argument("folder", type=Path, nargs="?")
    command.add_argument("port", type=int, nargs="?", default=0)
    command.add_argument("--send", type=int, metavar="PORT")
    arguments = command.parse_args()
    if arguments.send is not None:
        devices = rowing_devices(load_model("sculler"), FAULTS)
        first = next(devices)
        print("ready", flush=True)
        asyncio.run(send(itertools.chain((first,), devices), "127.0.0.1", arguments.send))
        return
    timed = asyncio.run(_session(arguments.folder, arguments.port))
    (arguments.folder / FIGURES).write_text(json.dumps(timed), encoding="utf-8")


if __name__ == "__main__":
    main()
