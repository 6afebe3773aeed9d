"""A live session in a process of its own, as `oarlock live run` has it, that also says what it estimated.

`python -m bench.live.child FOLDER RATE_HZ PORT` receives datagrams until SIGINT; with `--virtual SECONDS` in place of
the port it gets the packets of the plan without waiting, and ends by itself.
"""

from __future__ import annotations

import argparse
import asyncio
import hashlib
import json
import signal
import struct
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.live.misbehaving import sent
from bench.live.virtual import VirtualTime, VirtualUdp
from oarlock import Model, load_model
from oarlock.live.emulators.rig import LINES, lines_rig
from oarlock.live.live import Live
from oarlock.live.page import page_server
from oarlock.live.picture import LivePicture
from oarlock.live.session import Estimate
from oarlock.rowing import StrokeFollower, live_look
from oarlock.rowing.simulation.emulated import STREAMS

FIGURES = "estimated.json"


@dataclass
class Digest:
    """An output that remembers all bits of all estimates in a few bytes."""

    count: int = 0
    last: Estimate | None = None
    _hash: Any = field(default_factory=hashlib.sha256)

    def put(self, estimate: Estimate) -> None:
        """Takes an estimate."""
        self.count, self.last = self.count + 1, estimate
        self._hash.update(struct.pack("<d", estimate.time_s))
        self._hash.update(estimate.belief.mean.tobytes() + estimate.belief.std.tobytes())

    def figures(self) -> dict[str, object]:
        """How many, the digest of all, and the last one bit for bit."""
        told: dict[str, object] = {"estimates": self.count, "digest": self._hash.hexdigest()}
        if self.last is not None:
            told["last_time_s"] = self.last.time_s
            told["last_mean"] = self.last.belief.mean.tobytes().hex()
            told["last_std"] = self.last.belief.std.tobytes().hex()
        return told


def pictured(model: Model) -> LivePicture:
    """The figure that the page of a rower shows."""
    drawn = live_look(model)
    return LivePicture.of(model) if drawn is None else LivePicture.of(model, drawn.look, drawn.strands)


def made(model: Model, folder: Path, rate_hz: float, port: int) -> Live:
    """A session in true time, with all that the command line gives it."""
    rig = lines_rig(model, "sculler", port, rate_hz, STREAMS)
    live = Live(rig, model, folder, picture=pictured(model), follower=StrokeFollower(model))
    page_server(live)
    return live


def made_virtual(model: Model, folder: Path, rate_hz: float, seconds: float) -> tuple[Live, VirtualUdp]:
    """A session that waits for nothing. Strokes are left out: their process would have to keep up."""
    time = VirtualTime()
    source = VirtualUdp(LINES, time, sent(model, seconds, rate_hz))
    rig = lines_rig(model, "sculler", 1, rate_hz, STREAMS)
    live = Live(rig, model, folder, picture=pictured(model), time=time, transport_of=lambda _: source)
    page_server(live)
    return live, source


async def run(live: Live, source: VirtualUdp | None = None) -> dict[str, object]:
    """Runs a session until a signal, or until the virtual source has ended; what it estimated."""
    digest = Digest()
    live.outputs = [digest]
    running = asyncio.ensure_future(live.run())
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, running.cancel)
    await live.started.wait()
    assert live.server is not None
    print(live.server.url, flush=True)
    if source is not None:
        ended = asyncio.ensure_future(source.has_ended.wait())
        await asyncio.wait([ended, running], return_when=asyncio.FIRST_COMPLETED)
        running.cancel()
    with suppress(asyncio.CancelledError):
        await running
    return digest.figures() | {"from_s": live.session.from_s}


def main() -> None:
    """Reads the command line."""
    command = argparse.ArgumentParser(prog="python -m bench.live.child", description=__doc__)
    command.add_argument("folder", type=Path)
    command.add_argument("rate_hz", type=float)
    command.add_argument("port", type=int, nargs="?", default=0)
    command.add_argument("--virtual", type=float, metavar="SECONDS")
    asked = command.parse_args()
    model = load_model("sculler")
    if asked.virtual is None:
        told = asyncio.run(run(made(model, asked.folder, asked.rate_hz, asked.port)))
    else:
        told = asyncio.run(run_virtual(model, asked.folder, asked.rate_hz, asked.virtual))
    (asked.folder / FIGURES).write_text(json.dumps(told), encoding="utf-8")


async def run_virtual(model: Model, folder: Path, rate_hz: float, seconds: float) -> dict[str, object]:
    """Runs a virtual session to its end."""
    live, source = made_virtual(model, folder, rate_hz, seconds)
    return await run(live, source)


if __name__ == "__main__":
    main()
