"""Runs a rig: sources, recorder, tracker and page together, in one event loop."""

from __future__ import annotations

import asyncio
import shutil
import time
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from oarlock.evaluation.child_process import child_pool
from oarlock.live.disk import reason_of
from oarlock.live.event_log import EventLog
from oarlock.live.folder import LiveFolder
from oarlock.live.frame import frame_of
from oarlock.live.guide.lead import Lead
from oarlock.live.health import Problems, Watch, health, lost
from oarlock.live.named_angles import LiveAngles
from oarlock.live.outputs.output import Output, SessionStart
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.rig import Rig, Source
from oarlock.live.server import PageServer
from oarlock.live.session import Estimate, LiveSession, command, order_of
from oarlock.live.swaps.swaps import Swaps, swapping
from oarlock.live.ties import ClockTest, Ties, looked
from oarlock.live.time_source import MACHINE_TIME, TimeSource
from oarlock.live.transports import opened
from oarlock.live.transports.transport import Transport
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Belief, Model
    from oarlock.live.picture import LivePicture
    from oarlock.recording.calibration import Calibration

FRAMES_HZ = 60.0
LOOK_S = 0.25
"""A sensor that fails is named within a second."""
LOOKS = 2
"""So many looks from one message of health to the next."""
DOINGS = ("track", "stop", "note", "assign", "swap", "guide")
"""What a viewer may ask for."""


class Follower(Protocol):
    """Recognises something in the estimates as they come."""

    @property
    def work(self) -> Callable[[Any, Calibration | None], Mapping[str, Any] | None]:
        """Makes a message, with the key `type`, of what `step` returned, in another process.

        Its second argument is the calibration that serves: a guided start replaces it.
        """

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
        lead: leads through a calibration session before tracking; None without. It needs the server.
        is_tracked_at_once: track without a command, as soon as all streams have been heard and their clocks settled
            and no guided start is open. A rig without streams has nothing to track.
        is_placement_watched: look for units in each other's place, in another process.
        on_event: gets each event as a sentence; the folder's log has them, too.
        time: true time, unless the session is simulated.
        transport_of: opens a source.
    """

    rig: Rig
    model: Model
    folder: Path
    calibration: Calibration | None = None
    server: PageServer | None = None
    picture: LivePicture | None = None
    outputs: Sequence[Output] = ()
    follower: Follower | None = None
    lead: Lead | None = None
    is_tracked_at_once: bool = True
    is_placement_watched: bool = True
    on_event: Callable[[str], None] = lambda text: None
    time: TimeSource = MACHINE_TIME
    transport_of: Callable[[Source], Transport] = opened
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
        start_ns = self.time.now_ns()
        self.session = LiveSession(self.rig, self.model, start_ns, self.calibration)
        self.transports = {name: self.transport_of(source) for name, source in self.rig.sources.items()}
        self._watch, self._problems = Watch(self.session.intake, self.transports), Problems()
        self._named = LiveAngles(self.model)
        self.is_tracked_at_once &= bool(self.rig.feeds)
        self._ties = Ties(self.session.intake) if self.rig.ties_clocks else None
        self._pool: ProcessPoolExecutor | None = None
        self._ties_pool: ProcessPoolExecutor | None = None
        self._swaps = Swaps(self.session, self._tell, self.time) if self.is_placement_watched else None
        self._newest: Estimate | None = None
        self._working: set[asyncio.Task[None]] = set()
        self._followed = 0
        self._published_s = 0.0
        if self.server is None:
            self.lead = None
        else:
            await self.server.start()
        plan = None if self.lead is None else self.lead.guide.plan
        try:
            place = LiveFolder.new(self.folder, self.rig, self.calibration, start_ns, plan)
            place.disk.insist("folder", place.check_free)
            await self._recorded(place, seconds)
        finally:
            if self.server is not None:
                await self.server.stop()

    async def _recorded(self, place: LiveFolder, seconds: float | None) -> None:
        """Runs with a recorder; a session that could not begin leaves no folder."""
        self._disk, self._log = place.disk, EventLog(place.disk)
        try:
            self._recorder = Recorder(self._disk, self._log.flush)
        except DataError:
            place.discard()
            raise
        has_begun = True
        try:
            self._start_beside(SessionStart(place.start_ns, place.start_epoch_s))
            await self._until_ended(seconds)
        except DataError:
            has_begun = bool(self.session.intake.devices)
            raise
        finally:
            for pool in (self._pool, self._ties_pool):
                if pool is not None:
                    pool.shutdown(wait=False, cancel_futures=True)
            self._pool = self._ties_pool = None
            self.deliver(command(self.time.now_ns(), "stop"))
            self._recorder.close()
            for output in self.outputs:
                output.close()
            if has_begun:
                self._finish(place)
            else:
                place.discard()

    def _start_beside(self, start: SessionStart) -> None:
        """Starts outputs and the process that follows; the session goes on without those that cannot be started."""
        for output in self.outputs:
            try:
                self._disk.insist(output.way.name, partial(output.start, start))
            except RuntimeError as error:
                output.problem = f"cannot be started: {error}"
        if self.follower is None and self.lead is None:
            return
        try:
            self._pool = self._disk.insist("another process", self._follower_pool)
            if self.lead is not None and self.server is not None:
                self.lead.join(
                    self.session, self.picture, self.deliver, self._tell, self.server.publish, self._pool
                )
        except (OSError, RuntimeError) as error:
            self._disk.fail("another process", f"cannot be started: {reason_of(error)}")
            self.lead = None

    def _follower_pool(self) -> ProcessPoolExecutor:
        pool = child_pool()
        if self.follower is not None:
            # The process starts and imports now, so that the first repetition is not late.
            pool.submit(_imported, self.follower.work)
        return pool

    def _finish(self, place: LiveFolder) -> None:
        """Writes the recording, then the last lines of the log."""
        missing = ""
        if self._recorder.lost:
            missing = f"{self._recorder.lost:,} packets found no room: {self._disk.problem}. "
        if self._recorder.elsewhere:
            missing += f"{self._recorder.elsewhere:,} packets are in {self._disk.second}. "
        try:
            for text in place.finish(self.model).missing:
                self._tell(text)
            if missing and not self._recorder.lost:
                self._tell(f"{missing}The recording has all of it")
        except Exception as error:  # the packets are there, whatever cannot be made of them
            raise DataError(
                f"{missing}The recording could not be written: {error}. "
                f"What was received before is whole in {place.path}: make room, then run "
                f"oarlock live recover {place.path}"
            ) from error
        finally:
            for _ in range(2):  # the log has its own failures, too
                self._tell_news()
                self._log.close()
            self._tell_news()
        if self._recorder.lost:
            raise DataError(f"{missing}What was received before is whole in {place.path}")

    @property
    def seconds(self) -> float:
        """Now, s from the session's start."""
        return self.session.intake.seconds(self.time.now_ns())

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
        if told["do"] == "guide":
            return (
                "this session has no guided start"
                if self.lead is None
                else self.lead.press(told.get("press"))
            )
        if told["do"] == "track" and self.lead is not None:
            self.lead.press("leave")
        if told["do"] == "swap":
            return self._swap(told.get("streams"))
        try:
            keys = order_of(told)
        except DataError as error:
            return str(error)
        del keys["do"]
        before = self.session.refused
        self.deliver(command(self.time.now_ns(), told["do"], **keys))
        if self.session.refused > before:
            return self.session.problems[-1]
        self._tell(_carried_out(told["do"], keys))
        return None

    def _swap(self, streams: object) -> str | None:
        """Exchanges the devices of two streams; what is tracked begins again, because its posture was wrong."""
        now_ns, pair = self.time.now_ns(), streams if isinstance(streams, list) else []
        try:
            packets = swapping(self.session, [str(one) for one in pair], now_ns)
        except DataError as error:
            return str(error)
        if self.session.tracker is not None:
            packets += [command(now_ns, "stop"), command(now_ns, "track")]
        for packet in packets:
            self.deliver(packet)
        self._tell(f"{' and '.join(pair)} were exchanged")
        return None

    async def _until_ended(self, seconds: float | None) -> None:
        tasks = [asyncio.create_task(t.run(self.deliver)) for t in self.transports.values()]
        tasks.append(asyncio.create_task(self._look_after()))
        if self._swaps is not None:
            tasks.append(asyncio.create_task(self._swaps.run()))
        if self.lead is not None:
            tasks.append(asyncio.create_task(self.lead.run()))
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
        """Who is silent, who is back, what the disk holds; and the start of tracking."""
        for look in count(1):
            await self.time.sleep(LOOK_S)
            now_s = self.seconds
            self._tell_news()
            sensors = {} if self._newest is None else self._newest.info.sensors
            for text in (
                *self._watch.events(now_s),
                *self._watch.fields(sensors, now_s),
                *self._problems.events(self._problems_now()),
            ):
                self._tell(text)
            is_awaited = self.lead is not None and self.lead.guide.is_open
            self.is_tracked_at_once &= self.session.tracker is None
            if self.is_tracked_at_once and not is_awaited and self._watch.is_ready(now_s):
                self.is_tracked_at_once = False
                self.deliver(command(self.time.now_ns(), "track"))
                self._tell("tracking")
            if why := self.session.divergence:
                self.deliver(command(self.time.now_ns(), "track"))
                self._tell(f"tracking begins again: {why}")
            self._tie(now_s)
            if self.server is not None and look % LOOKS == 0:
                free = _free_bytes(self.folder)
                told = health(self.session, self.transports, self._recorder, free, now_s)
                swapped = [] if self._swaps is None else list(self._swaps.verdicts.named)
                outputs = [output.health() for output in self.outputs]
                self.server.publish({**told, "swapped": swapped, "outputs": outputs})

    def _problems_now(self) -> dict[str, str]:
        """What is wrong with sources and outputs: empty for those that work, absent for those that try."""
        states = {f"source {name}": t.state for name, t in self.transports.items()}
        return {
            **{name: problem for name, state in states.items() if (problem := lost(state)) is not None},
            **{output.way.name: output.problem for output in self.outputs},
        }

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
            self._keep(self._tied(self._ties, look))

    async def _tied(self, ties: Ties, look: ClockTest) -> None:
        loop = asyncio.get_running_loop()
        try:
            if self._ties_pool is None:
                self._ties_pool = child_pool()
            found = await loop.run_in_executor(self._ties_pool, looked, look, self.model)
        except (OSError, RuntimeError) as error:
            self._ties = None
            self._tell(f"clocks are no longer compared: {error}")
            return
        for keys in ties.commands(look, found, self.seconds):
            self.deliver(command(self.time.now_ns(), "clock", **keys))
            self._tell(
                f"the movement shows that {keys['stream']} is {1e3 * keys['late_s']:+.1f} ms late "
                f"(± {1e3 * keys['std_s']:.1f} ms): its times are corrected"
            )

    async def _work(self, follower: Follower, task: object) -> None:
        loop = asyncio.get_running_loop()
        try:
            message = await loop.run_in_executor(self._pool, follower.work, task, self.session.calibration)
        except (OSError, RuntimeError) as error:
            self._pool = None
            self._tell(f"it is no longer followed what is repeated: {error}")
            return
        if message is not None:
            self._followed += 1
            self._announce({**message, "number": self._followed})

    def _tell(self, text: str) -> None:
        now_s = self.seconds
        try:
            self.on_event(text)
            self._disk.works("terminal")
        except (OSError, ValueError) as error:  # it was closed, or is a file on a disk that is full
            self._disk.fail("terminal", f"cannot be written: {reason_of(error)}")
        self._log.write(now_s, text)
        self._announce({"type": "event", "time_s": round(now_s, 2), "text": text})

    def _tell_news(self) -> None:
        """What has failed on the disk, and what works again."""
        for text in self._disk.news():
            self._tell(text)

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
