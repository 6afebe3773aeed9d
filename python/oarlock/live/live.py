"""Runs a rig: sources, recorder, tracker and page together, in one event loop."""

from __future__ import annotations

import asyncio
import shutil
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from oarlock.live.folder import LiveFolder
from oarlock.live.frame import frame_of
from oarlock.live.health import Problems, Watch, health, lost
from oarlock.live.named_angles import NamedAngles
from oarlock.live.outputs.output import Output, Start
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.rig import Rig
from oarlock.live.server import PageServer
from oarlock.live.session import Estimate, LiveSession, command
from oarlock.live.transports import opened
from oarlock.live.transports.transport import Transport, now_ns
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Belief, Model
    from oarlock.live.picture import LivePicture
    from oarlock.recording.calibration import Calibration

FRAMES_HZ = 60.0
HEALTH_S = 0.5
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
        outputs: other programs that get each estimate, event and repetition.
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
        self._watch, self._problems = Watch(self.session.intake), Problems()
        self._named = NamedAngles(self.model)
        self._newest: Estimate | None = None
        self._working: set[asyncio.Task[None]] = set()
        self._followed = 0
        self._published_s = 0.0
        if self.server is not None:
            await self.server.start()
        try:
            place = LiveFolder.create(self.folder, self.rig, self.calibration, start_ns)
            await self._recorded(place, seconds)
        finally:
            if self.server is not None:
                await self.server.stop()

    async def _recorded(self, place: LiveFolder, seconds: float | None) -> None:
        """Runs with a recorder; a session that could not begin leaves no folder."""
        self._recorder = Recorder(place.packets)
        for output in self.outputs:
            output.start(Start(place.start_ns, place.start_epoch_s))
        self._pool = None if self.follower is None else _pool()
        if self._pool is not None and self.follower is not None:
            # The process starts and imports now, so that the first repetition is not late.
            self._pool.submit(_imported, self.follower.work)
        has_begun = True
        try:
            await self._until_ended(seconds)
        except DataError:
            has_begun = bool(self.session.intake.devices)
            raise
        finally:
            if self._pool is not None:
                self._pool.shutdown(wait=False, cancel_futures=True)
            self.deliver(command(now_ns(), "stop"))
            self._recorder.close()
            for output in self.outputs:
                output.close()
            if has_begun:
                self._finish(place)
            else:
                place.discard()

    def _finish(self, place: LiveFolder) -> None:
        missing = ""
        if self._recorder.problem:
            missing = f"the last {self._recorder.lost:,} packets found no room: {self._recorder.problem}. "
        try:
            place.finish(self.model)
        except (DataError, OSError) as error:
            raise DataError(
                f"{missing}The recording could not be written: {error}. "
                f"What was received before is whole in {place.packets}: make room, then run "
                f"oarlock live recover {place.path}"
            ) from error
        if missing:
            raise DataError(f"{missing}What was received before is whole in {place.path}")

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
                # before the recording is written, which holds up this loop
                await self.server.stop()

    async def _look_after(self) -> None:
        """Twice a second: who is silent, who is back, what the disk holds; and the start of tracking."""
        while True:
            await asyncio.sleep(HEALTH_S)
            now_s = self.session.intake.seconds(now_ns())
            for text in (*self._watch.events(now_s), *self._problems.events(self._problems_now())):
                self._tell(text)
            if self.is_tracked_at_once and self.session.tracker is None and self._watch.is_ready(now_s):
                self.is_tracked_at_once = False
                self.deliver(command(now_ns(), "track"))
                self._tell("tracking")
            if self.server is not None:
                states = {name: t.state for name, t in self.transports.items()}
                told = health(self.session, states, self._recorder, _free_bytes(self.folder), now_s)
                self.server.publish({**told, "outputs": [output.health() for output in self.outputs]})

    def _problems_now(self) -> dict[str, str]:
        """What is wrong with recorder, sources and outputs: empty for those that work, absent for those that try."""
        states = {f"source {name}": t.state for name, t in self.transports.items()}
        return {
            "recorder": self._recorder.problem,
            **{name: problem for name, state in states.items() if (problem := lost(state)) is not None},
            **{output.way.name: output.problem for output in self.outputs},
        }

    def _follow(self, estimate: Estimate) -> None:
        task = None if self.follower is None else self.follower.step(estimate.time_s, estimate.belief)
        if task is not None and self.follower is not None and self._pool is not None:
            working = asyncio.get_running_loop().create_task(self._work(self.follower, task))
            # The loop itself keeps no reference to its tasks.
            self._working.add(working)
            working.add_done_callback(self._working.discard)

    async def _work(self, follower: Follower, task: object) -> None:
        loop = asyncio.get_running_loop()
        try:
            message = await loop.run_in_executor(self._pool, follower.work, task)
        except (BrokenProcessPool, RuntimeError) as error:
            self._pool = None
            self._tell(f"it is no longer followed what is repeated: {error}")
            return
        if message is not None:
            self._followed += 1
            self._announce({**message, "number": self._followed})

    def _tell(self, text: str) -> None:
        self.on_event(text)
        now_s = self.session.intake.seconds(now_ns())
        self._announce({"type": "event", "time_s": round(now_s, 2), "text": text})

    def _announce(self, message: Mapping[str, Any]) -> None:
        """Tells viewers and outputs what happened."""
        if self.server is not None:
            self.server.announce(message)
        for output in self.outputs:
            output.tell(message)

    def _publish(self) -> None:
        now_s = time.monotonic()
        if self.server is None or self._newest is None or now_s - self._published_s < 1.0 / FRAMES_HZ:
            return
        self._published_s = now_s
        self.server.publish(frame_of(self._newest, self.model, self.picture, self._named))
        self._newest = None


def _pool() -> ProcessPoolExecutor:
    """Another process, which leaves Ctrl-C to this one."""
    return ProcessPoolExecutor(1, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN))


def _imported(work: object) -> None:
    """Makes another process import what work needs, which it does to receive it."""


def _free_bytes(folder: Path) -> int | None:
    """Room on the folder's disk; None where it cannot be read, because the disk was taken away."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None


def _carried_out(do: str, keys: Mapping[str, Any]) -> str:
    """The event of a command that was carried out."""
    if do == "note":
        return f"note: {keys.get('text', '')}"
    if do == "assign":
        return f"{keys['device']} feeds {keys['stream']} from now on"
    return {"track": "tracking", "stop": "tracking was stopped"}[do]
