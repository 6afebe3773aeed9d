"""A live session in a process of its own, as `oarlock live run` has it, that also says what it estimated.

`python -m oarlock_lab.soak.child FOLDER RATE_HZ PORT` receives datagrams until SIGINT; with
`--virtual SECONDS` in place of the port it gets the packets of the plan without waiting, and ends by itself.
"""

from __future__ import annotations

import argparse
import asyncio
import hashlib
import json
import signal
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from oarlock import Belief, Calibration, Model, load_model
from oarlock.live.live import Live
from oarlock.live.page import page_server
from oarlock.live.picture import LivePicture
from oarlock.live.simulated_devices import LINES, lines_rig
from oarlock.rowing import StrokeFollower, live_look
from oarlock.rowing.simulation.emulated import STREAMS
from oarlock_lab.soak.misbehaving import sent
from oarlock_lab.soak.virtual import VirtualTime, VirtualUdp

FIGURES = "estimated.json"


@dataclass
class Digest:
    """Remembers all bits of all estimates in a few bytes."""

    count: int = 0
    last: tuple[float, Belief] | None = None
    _hash: Any = field(default_factory=hashlib.sha256)

    def put(self, time_s: float, belief: Belief) -> None:
        """Takes an estimate."""
        self.count, self.last = self.count + 1, (time_s, belief)
        self._hash.update(struct.pack("<d", time_s) + belief.mean.tobytes() + belief.std.tobytes())

    def figures(self) -> dict[str, object]:
        """How many, the digest of all, and the last one bit for bit."""
        figures: dict[str, object] = {"estimates": self.count, "digest": self._hash.hexdigest()}
        if self.last is not None:
            time_s, belief = self.last
            figures["last_time_s"] = time_s
            figures["last_mean"] = belief.mean.tobytes().hex()
            figures["last_std"] = belief.std.tobytes().hex()
        return figures


@dataclass
class Noted:
    """A follower of a session that notes each estimate before another follower gets it.

    Args:
        digest: of the estimates.
        strokes: finds strokes; None: nobody does.
    """

    digest: Digest
    strokes: StrokeFollower | None = None

    @property
    def work(self) -> Callable[[Any, Calibration | None], Mapping[str, Any] | None]:
        """Of the other follower."""
        return no_message if self.strokes is None else self.strokes.work

    def step(self, time_s: float, belief: Belief) -> object | None:
        """What the other follower has to do."""
        self.digest.put(time_s, belief)
        return None if self.strokes is None else self.strokes.step(time_s, belief)


def no_message(task: object, calibration: Calibration | None) -> None:
    """The work of a follower that finds nothing."""


def pictured(model: Model) -> LivePicture:
    """The figure that the page of a rower shows."""
    drawn = live_look(model)
    return LivePicture.of(model) if drawn is None else LivePicture.of(model, drawn.look, drawn.strands)


def made(model: Model, folder: Path, rate_hz: float, port: int) -> Live:
    """A session in true time, with all that the command line gives it."""
    rig = lines_rig(model, "sculler", port, rate_hz, STREAMS)
    follower = Noted(Digest(), StrokeFollower(model))
    live = Live(rig, model, folder, picture=pictured(model), follower=follower)
    page_server(live)
    return live


def made_virtual(model: Model, folder: Path, rate_hz: float, seconds: float) -> tuple[Live, VirtualUdp]:
    """A session that waits for nothing. What other processes do is left out: they could not keep up."""
    time = VirtualTime()
    source = VirtualUdp(LINES, time, sent(model, seconds, rate_hz))
    rig = lines_rig(model, "sculler", 1, rate_hz, STREAMS)
    rig = replace(rig, ties_clocks=False)
    live = Live(
        *(rig, model, folder),
        picture=pictured(model),
        follower=Noted(Digest()),
        is_placement_watched=False,
        time=time,
        transport_of=lambda _: source,
    )
    page_server(live)
    return live, source


async def run(live: Live, source: VirtualUdp | None = None) -> dict[str, object]:
    """Runs a session until a signal, or until the virtual source has ended; what it estimated."""
    running = asyncio.ensure_future(live.run())
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, running.cancel)
    started = asyncio.ensure_future(live.started.wait())
    await asyncio.wait([started, running], return_when=asyncio.FIRST_COMPLETED)
    if running.done():
        started.cancel()
        await running
    assert live.server is not None and isinstance(live.follower, Noted)
    print(live.server.url, flush=True)
    if source is not None:
        ended = asyncio.ensure_future(source.has_ended.wait())
        await asyncio.wait([ended, running], return_when=asyncio.FIRST_COMPLETED)
        running.cancel()
    with suppress(asyncio.CancelledError):
        await running
    return live.follower.digest.figures() | {"from_s": live.session.from_s}


def main() -> None:
    """Reads the command line."""
    command = argparse.ArgumentParser(prog="python -m oarlock_lab.soak.child", description=__doc__)
    command.add_argument("folder", type=Path)
    command.add_argument("rate_hz", type=float)
    command.add_argument("port", type=int, nargs="?", default=0)
    command.add_argument("--virtual", type=float, metavar="SECONDS")
    arguments = command.parse_args()
    model = load_model("sculler")
    if arguments.virtual is None:
        figures = asyncio.run(run(made(model, arguments.folder, arguments.rate_hz, arguments.port)))
    else:
        figures = asyncio.run(run_virtual(model, arguments.folder, arguments.rate_hz, arguments.virtual))
    (arguments.folder / FIGURES).write_text(json.dumps(figures), encoding="utf-8")


async def run_virtual(model: Model, folder: Path, rate_hz: float, seconds: float) -> dict[str, object]:
    """Runs a virtual session to its end."""
    live, source = made_virtual(model, folder, rate_hz, seconds)
    return await run(live, source)


if __name__ == "__main__":
    main()
