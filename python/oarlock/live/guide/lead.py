"""`Lead`: runs a guided start within a live session: its clock, the readings of its steps, its orders and verdicts."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.session.checks import REDO
from oarlock.live.guide.pictures import pictures_of
from oarlock.live.guide.steps import PAD_S, PRESSES, CheckSteps, Cut, Guide, Listen, Order, Send, Swap
from oarlock.live.guide.verdict import Task, Verdict, judged, prepared
from oarlock.live.health import SILENT_S
from oarlock.live.intake import SensorReading
from oarlock.live.reading import Packet
from oarlock.live.rows import StreamBuffer
from oarlock.live.session import LiveSession, command
from oarlock.live.swaps.swaps import swapping
from oarlock.live.transports.transport import now_ns
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock.live.picture import LivePicture
    from oarlock.recording.recording import Recording

LOOK_S = 0.05
REPEAT_S = 0.5
"""The state is published so often, for viewers who come later, and whenever it changes."""


@dataclass
class Lead:
    """Leads a person through a guide.

    Args:
        guide: its state.
    """

    guide: Guide
    _rows: StreamBuffer = field(init=False)
    _parts: dict[str, Recording] = field(init=False, default_factory=dict)
    _newest_s: dict[str, float] = field(init=False, default_factory=dict)
    _is_listening: bool = field(init=False, default=False)
    _shown: tuple[Mapping[str, Any], float] = field(init=False, default=({}, 0.0))
    _judging: set[asyncio.Task[None]] = field(init=False, default_factory=set)

    def join(
        self,
        session: LiveSession,
        picture: LivePicture | None,
        deliver: Callable[[Packet], None],
        tell: Callable[[str], None],
        publish: Callable[[Mapping[str, Any]], None],
        pool: Executor,
    ) -> None:
        """Becomes part of a session that begins.

        Args:
            session: whose readings are used.
            picture: the figure of the page; None without.
            deliver: takes commands as packets.
            tell: takes events.
            publish: takes the state for the page.
            pool: of another process, in which steps are judged.
        """
        self.session, self._pool = session, pool
        self._deliver, self._tell, self._publish = deliver, tell, publish
        self._rows = StreamBuffer(session.rig)
        session.listeners.append(self._hear)
        self.hello = self._described(picture)
        # The other process starts while the person reads.
        pool.submit(prepared)

    def _described(self, picture: LivePicture | None) -> dict[str, Any]:
        """What a page needs once."""
        steps = [one.step for one in self.guide.progress]
        pictures = pictures_of(self.session.model, steps, picture)
        about = zip(steps, pictures, strict=True)
        return {
            "plan": self.guide.plan.name,
            "steps": [
                {"name": s.name, "kind": s.kind, "say": s.say, "optional": s.optional, "pictures": p}
                for s, p in about
            ],
        }

    def press(self, what: object) -> str | None:
        """Carries out what a viewer pressed; why not, if it cannot."""
        if what not in PRESSES:
            return f"press '{str(what)[:40]}' is unknown; expected {', '.join(PRESSES)}"
        self._carry_out(self.guide.press(str(what), self._now_s(), self.missing()))
        self._show()
        return None

    async def run(self) -> None:
        """Looks at the clock, until it is cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            self._carry_out(self.guide.tick(self._now_s(), self.missing(), self._heard_s()))
            self._show()

    def missing(self) -> list[str]:
        """Inertial units whose readings cannot be used now."""
        intake = self.session.intake
        unsettled = {s for d in intake.devices.values() if not d.is_settled for s in d.streams}
        settled = {s for d in intake.devices.values() if d.is_settled for s in d.streams}
        lacking = {*intake.silent(self._now_s(), SILENT_S), *(unsettled - settled)}
        return [
            feed.stream for feed in self.session.rig.feeds if feed.kind == "imu" and feed.stream in lacking
        ]

    def _heard_s(self) -> float:
        """All units have been heard up to this time."""
        units = [feed.stream for feed in self.session.rig.feeds if feed.kind == "imu"]
        return min((self._newest_s.get(name, -np.inf) for name in units), default=np.inf)

    def _now_s(self) -> float:
        return self.session.intake.seconds(now_ns())

    def _hear(self, sampled: list[SensorReading]) -> None:
        for one in sampled:
            self._newest_s[one.stream] = one.time_s
        if self._is_listening:
            self._rows.add(sampled)

    def _show(self) -> None:
        told, now_s = self.guide.told(), self._now_s()
        if told != self._shown[0] or now_s > self._shown[1] + REPEAT_S:
            self._shown = (told, now_s)
            self._publish(told)

    def _carry_out(self, orders: Sequence[Order]) -> None:
        for order in orders:
            if isinstance(order, Send):
                self._send(order)
            elif isinstance(order, Listen):
                self._rows.clear()
                self._is_listening = True
            elif isinstance(order, Cut):
                self._cut(order)
            elif isinstance(order, CheckSteps):
                self._start(order)
            else:
                self._swap(order)

    def _send(self, order: Send) -> None:
        if order.do == "stop" and self.session.tracker is None:
            return
        self._deliver(command(now_ns(), order.do, **order.keys))
        events = {"calibrate": "the guided calibration is used from now on", "track": "tracking"}
        if order.do in events:
            self._tell(events[order.do])

    def _cut(self, order: Cut) -> None:
        self._is_listening = False
        self._parts.pop(order.name, None)
        begin_s, end_s = order.span_s
        try:
            self._parts[order.name] = self._rows.recording(from_s=begin_s - PAD_S, to_s=end_s + PAD_S)
        except DataError:
            self._tell(f'guided start: nothing was heard in "{order.name}"')
        self._rows.clear()

    def _start(self, order: CheckSteps) -> None:
        steps = sorted(order.plan.steps, key=lambda step: step.start_s or 0.0)
        parts = [self._parts[step.name] for step in steps if step.name in self._parts]
        task = Task(order.number, self.session.model, order.plan, parts, self.session.calibration)
        judging = asyncio.get_running_loop().create_task(self._judge(task))
        # The loop itself keeps no reference to its tasks.
        self._judging.add(judging)
        judging.add_done_callback(self._judging.discard)

    async def _judge(self, task: Task) -> None:
        try:
            verdict = await asyncio.get_running_loop().run_in_executor(self._pool, judged, task)
        except BrokenProcessPool as error:
            self._tell(f"the guided start has ended, its steps cannot be judged: {error}")
            self._carry_out(self.guide.press("leave", self._now_s()))
            return
        except Exception as error:
            # A step that breaks the search is done again; the session goes on.
            sentence = f"It could not be judged ({error}). Do it again, with care."
            verdict = Verdict(task.number, {task.newest: (REDO, sentence)})
        for name, (outcome, sentence) in verdict.steps.items():
            if name == task.newest or outcome == REDO:
                self._tell(f'step "{name}": {"do it again" if outcome == REDO else "passed"}. {sentence}')
        if verdict.exchanged:
            self._tell(f"{' and '.join(verdict.exchanged)} sit in each other's place")
        self._carry_out(self.guide.judged(verdict))
        self._show()

    def _swap(self, order: Swap) -> None:
        """Each of two streams gets the device that fed the other last."""
        one, other = order.streams
        try:
            for packet in swapping(self.session, order.streams, now_ns()):
                self._deliver(packet)
        except DataError as error:
            self._tell(f"guided start: {error}")
            return
        self._parts.clear()
        self._tell(f"{one} and {other} were exchanged")
