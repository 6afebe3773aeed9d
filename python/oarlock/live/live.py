"""Runs a rig: sources, recorder, tracker and page together, in one event loop."""

from __future__ import annotations

import asyncio
import shutil
import time
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from oarlock.live.folder import LiveFolder
from oarlock.live.health import Watch, health
from oarlock.live.outputs import Output, frame_of
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.rig import Rig
from oarlock.live.server import PageServer
from oarlock.live.session import Estimate, LiveSession, command
from oarlock.live.ties import Look, Ties, looked
from oarlock.live.transports import opened
from oarlock.live.transports.transport import Transport, now_ns

if TYPE_CHECKING:
    from oarlock._core import Belief, Model
    from oarlock.live.picture import LivePicture
    from oarlock.recording.calibration import Calibration

FRAMES_HZ = 60.0
LOOK_S = 0.25
"""A sensor that fails is named within a second."""
LOOKS = 2
"""So many looks from one message of health to the next."""
DOINGS = ("track", "stop", "note", "assign")
"""What a viewer may ask for."""


class Follower(Protocol):
    """Recognises something in the estimates as they come."""

    @property
    def work(self) -> Callable[[Any], Mapping[str, Any] | None]:
        """Makes a message, with the key `type`, of what `step` returned. It runs in another process."""

    def step(self, time_s: float, belief: Belief) -> object | None:
        """What is to be worked on, if an estimate completes something; quick, because the tracker waits."""


@dataclass
class Live:
    """A running session.

    Args:
        rig: sources, and which device feeds which sensor.
        model: of the body.
        folder: where it is recorded.
        calibration: mounts, biases and lengths; None for the model's.
        server: page and WebSocket; None without.
        picture: the figure of the page; None without.
        outputs: what else gets each estimate.
        follower: makes messages of what it recognises in the estimates, such as repetitions; None without.
        is_tracked_at_once: track without a command, as soon as all streams have been heard and their clocks settled.
    """

    rig: Rig
    model: Model
    folder: Path
    calibration: Calibration | None = None
    server: PageServer | None = None
    picture: LivePicture | None = None
    outputs: Sequence[Output] = ()
    follower: Follower | None = None
    is_tracked_at_once: bool = True
    on_event: Callable[[str], None] = lambda text: None
    session: LiveSession = field(init=False)
    transports: dict[str, Transport] = field(init=False)
    estimates: int = field(init=False, default=0)
    started: asyncio.Event = field(init=False, default_factory=asyncio.Event)
    """Set when the sources and the page are open."""

    async def run(self, seconds: float | None = None) -> None:
        """Runs until it is cancelled, or for so long; then the recording is written.

        Raises:
            DataError: a source or the page cannot be opened, or the folder cannot be written.
        """
        start_ns = now_ns()
        self.session = LiveSession(self.rig, self.model, start_ns, self.calibration)
        self.transports = {name: opened(source) for name, source in self.rig.sources.items()}
        self._watch = Watch(self.session.intake)
        self._ties = Ties(self.session.intake) if self.rig.ties_clocks else None
        self._ties_pool: ProcessPoolExecutor | None = None
        self._newest: Estimate | None = None
        self._working: set[asyncio.Task[None]] = set()
        self._followed = 0
        self._published_s = 0.0
        place = LiveFolder.create(self.folder, self.rig, self.calibration, start_ns)
        self._recorder = Recorder(place.packets)
        self._pool = None if self.follower is None else ProcessPoolExecutor(1, get_context("spawn"))
        try:
            await self._until_ended(seconds)
        finally:
            for pool in (self._pool, self._ties_pool):
                if pool is not None:
                    pool.shutdown(wait=False, cancel_futures=True)
            self.deliver(command(now_ns(), "stop"))
            self._recorder.close()
            place.finish(self.model)

    def deliver(self, packet: Packet) -> None:
        """Takes a packet: to the disk, to the tracker, and its estimates to all who listen."""
        self._recorder.write(packet)
        for estimate in self.session.take(packet):
            self.estimates += 1
            self._newest = estimate
            for output in self.outputs:
                output.put(estimate)
            self._follow(estimate)
        self._publish()

    def do(self, told: Mapping[str, Any]) -> str | None:
        """Carries out a viewer's command; why not, if it cannot."""
        if told["do"] not in DOINGS:
            return f"'{str(told['do'])[:40]}' is unknown; expected {', '.join(DOINGS)}"
        keys = {str(k): v for k, v in told.items() if k != "do"}
        before = len(self.session.problems)
        self.deliver(command(now_ns(), told["do"], **keys))
        if len(self.session.problems) > before:
            return self.session.problems[-1]
        self._tell(_carried_out(told["do"], keys))
        return None

    async def _until_ended(self, seconds: float | None) -> None:
        if self.server is not None:
            await self.server.start()
        tasks = [asyncio.create_task(t.run(self.deliver)) for t in self.transports.values()]
        tasks.append(asyncio.create_task(self._look_after()))
        await asyncio.sleep(0.0)
        self.started.set()
        try:
            done, _ = await asyncio.wait(tasks, timeout=seconds, return_when=asyncio.FIRST_EXCEPTION)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            if self.server is not None:
                await self.server.stop()

    async def _look_after(self) -> None:
        """Who is silent, who is back, what the disk holds; and the start of tracking."""
        for look in count(1):
            await asyncio.sleep(LOOK_S)
            now_s = self.session.intake.seconds(now_ns())
            for text in self._watch.events(now_s):
                self._tell(text)
            if self.is_tracked_at_once and self.session.tracker is None and self._watch.is_ready(now_s):
                self.is_tracked_at_once = False
                self.deliver(command(now_ns(), "track"))
                self._tell("tracking")
            self._tie(now_s)
            if self.server is not None and look % LOOKS == 0:
                free = shutil.disk_usage(self.folder).free
                states = {name: t.state for name, t in self.transports.items()}
                self.server.publish(health(self.session, states, self._recorder, free, now_s))

    def _follow(self, estimate: Estimate) -> None:
        task = None if self.follower is None else self.follower.step(estimate.time_s, estimate.belief)
        if task is not None and self.follower is not None and self._pool is not None:
            self._keep(self._work(self.follower, task))

    def _keep(self, work: Coroutine[Any, Any, None]) -> None:
        working = asyncio.get_running_loop().create_task(work)
        # The loop itself keeps no reference to its tasks.
        self._working.add(working)
        working.add_done_callback(self._working.discard)

    def _tie(self, now_s: float) -> None:
        """Compares the devices' clocks from time to time, in another process."""
        if self._ties is None or self.session.tracker is None:
            return
        look = self._ties.look(now_s, self.session.calibration)
        if look is not None:
            if self._ties_pool is None:
                self._ties_pool = ProcessPoolExecutor(1, get_context("spawn"))
            self._keep(self._tied(self._ties, look, self._ties_pool))

    async def _tied(self, ties: Ties, look: Look, pool: ProcessPoolExecutor) -> None:
        loop = asyncio.get_running_loop()
        try:
            found = await loop.run_in_executor(pool, looked, look, self.model)
        except (BrokenProcessPool, RuntimeError) as error:
            self._ties = None
            self._tell(f"clocks are no longer compared: {error}")
            return
        for keys in ties.commands(look, found, self.session.intake.seconds(now_ns())):
            self.deliver(command(now_ns(), "clock", **keys))
            self._tell(
                f"the movement shows that {keys['stream']} is {1e3 * keys['late_s']:+.1f} ms late "
                f"(± {1e3 * keys['std_s']:.1f} ms): its times are corrected"
            )

    async def _work(self, follower: Follower, task: object) -> None:
        loop = asyncio.get_running_loop()
        try:
            message = await loop.run_in_executor(self._pool, follower.work, task)
        except (BrokenProcessPool, RuntimeError) as error:
            self._pool = None
            self._tell(f"it is no longer followed what is repeated: {error}")
            return
        if message is not None and self.server is not None:
            self._followed += 1
            self.server.announce({**message, "number": self._followed})

    def _tell(self, text: str) -> None:
        self.on_event(text)
        if self.server is not None:
            now_s = self.session.intake.seconds(now_ns())
            self.server.announce({"type": "event", "time_s": round(now_s, 2), "text": text})

    def _publish(self) -> None:
        now_s = time.monotonic()
        if self.server is None or self._newest is None or now_s - self._published_s < 1.0 / FRAMES_HZ:
            return
        self._published_s = now_s
        self.server.publish(frame_of(self._newest, self.model, self.picture))
        self._newest = None


def _carried_out(do: str, keys: Mapping[str, Any]) -> str:
    """The event of a command that was carried out."""
    if do == "note":
        return f"note: {keys.get('text', '')}"
    if do == "assign":
        return f"{keys['device']} feeds {keys['stream']} from now on"
    return {"track": "tracking", "stop": "tracking was stopped"}[do]
