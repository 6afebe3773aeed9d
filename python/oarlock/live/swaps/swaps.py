"""`Swaps`: notices within a session that two units sit in each other's place, while they are tracked."""

from __future__ import annotations

import asyncio
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from oarlock.evaluation.child_process import child_pool
from oarlock.live.intake import DeviceState, SensorReading
from oarlock.live.lately import Lately
from oarlock.live.session import LiveSession, command
from oarlock.live.swaps.search import Seen, SwapTest, looked, prepared
from oarlock.live.swaps.window import WINDOW_S
from oarlock.live.time_source import MACHINE_TIME, TimeSource
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock.live.reading import Packet

KEPT_S = 2.0
"""Readings are kept so long: longer than the slowest way of one."""
STEP_S, CALM_STEP_S = 0.15, 1.0
"""From one look to the next: while something is suspected or tracking is young, and later."""
CALM_AFTER = 20
"""So many looks in a row without suspicion."""
EXPLAINS, ALIKE = 1.6, 1.4
"""By so much must an exchange lower the cost, and be better than the second best, in two looks in a row."""
CLEARLY, ALONE = 3.0, 2.0
"""The same for one look."""
MOST_AFTER = 2.0
"""Cost of a reading that an exchange may leave: else something else is wrong."""
_LEAST_ROWS = 4


@dataclass
class Verdicts:
    """Makes of what single looks show the pair that is named."""

    named: tuple[str, ...] = ()
    calm: int = 0
    """Looks in a row that fit as they are."""
    _suspected: tuple[str, ...] = ()

    def take(self, seen: Seen) -> tuple[str, ...]:
        """The pair, if this look is what names it; else nothing."""
        pair, is_clear = suspected(seen)
        self.calm = 0 if pair else self.calm + 1
        is_sure = bool(pair) and (is_clear or pair == self._suspected)
        self._suspected = pair
        if not pair and self.calm >= CALM_AFTER:
            self.named = ()
        if not is_sure or pair == self.named:
            return ()
        self.named = pair
        return pair


def suspected(seen: Seen) -> tuple[tuple[str, ...], bool]:
    """The pair that a look suspects, and whether the look is enough to name it."""
    if not seen.exchanged or seen.after > MOST_AFTER:
        return (), False
    lower, better = seen.cost / seen.after, seen.next_best / seen.after
    if lower < EXPLAINS or better < ALIKE:
        return (), False
    return seen.exchanged, lower > CLEARLY and better > ALONE


@dataclass
class Swaps:
    """Looks again and again, in another process, at the last readings of a session.

    Args:
        session: whose readings are looked at.
        tell: takes events.
        time: true time, unless the session is simulated.
    """

    session: LiveSession
    tell: Callable[[str], None]
    time: TimeSource = MACHINE_TIME
    verdicts: Verdicts = field(default_factory=Verdicts)
    _lately: dict[str, Lately] = field(default_factory=dict)
    _newest_s: dict[str, float] = field(default_factory=dict)
    _looked_s: float = -math.inf
    _since_s: float = math.inf
    """Units sit where they are since this time."""
    _fed_by: dict[str, DeviceState] = field(default_factory=dict)

    def __post_init__(self) -> None:
        feeds = [feed for feed in self.session.rig.feeds if feed.kind in ("imu", "scalar")]
        self._lately = {feed.stream: Lately(feed, KEPT_S) for feed in feeds}
        self._units = [feed.stream for feed in feeds if feed.kind == "imu"]
        self.session.listeners.append(self._hear)

    async def run(self) -> None:
        """Looks until it is cancelled."""
        if len(self._units) < 2:
            return
        loop, pool = asyncio.get_running_loop(), None
        try:
            pool = _pool()
            while True:
                await self.time.sleep(STEP_S if self.verdicts.calm < CALM_AFTER else CALM_STEP_S)
                look = self.look()
                if look is not None:
                    self._judge(look, await loop.run_in_executor(pool, looked, look, self.session.model))
        except (OSError, RuntimeError, ValueError, ArithmeticError) as error:
            # The session itself goes on, whatever its readings did here.
            self.tell(f"swapped units are no longer looked for: {error}")
        finally:
            if pool is not None:
                pool.shutdown(wait=False, cancel_futures=True)

    def look(self) -> SwapTest | None:
        """What is to be looked at now; None if nothing is tracked, or too little was heard of two units."""
        tracker = self.session.tracker
        belief = None if tracker is None else tracker.belief
        ends_s = min((self._newest_s.get(name, -math.inf) for name in self._units), default=-math.inf)
        self._see_exchanges()
        if belief is None or ends_s < max(self._looked_s + STEP_S, self._since_s + WINDOW_S):
            return None
        self._looked_s = ends_s
        found = [own.since(ends_s - WINDOW_S) for own in self._lately.values()]
        rows = tuple(own for own in found if len(own) >= _LEAST_ROWS)
        if sum(own.feed.kind == "imu" for own in rows) < 2:
            return None
        known = dict(zip(belief.state_names, belief.mean.tolist(), strict=True))
        posture = tuple(known.get(name, math.nan) for name in self.session.model.coordinate_names)
        return SwapTest(rows, ends_s - 0.5 * WINDOW_S, posture, self.session.calibration)

    def _see_exchanges(self) -> None:
        """What was read before units were exchanged says nothing of where they sit now."""
        feeding = self.session.intake.feeding()
        fed_by = {name: feeding[name] for name in self._units if name in feeding}
        if any(self._fed_by.get(name, device) is not device for name, device in fed_by.items()):
            self.verdicts, self._since_s = Verdicts(), max(self._newest_s.values())
        self._fed_by.update(fed_by)

    def _judge(self, look: SwapTest, seen: Seen) -> None:
        pair = self.verdicts.take(seen)
        if pair:
            one, other = sorted(pair, key=self._units.index)
            self.tell(f"{one} and {other} are swapped: exchange the units on the body, or in the session")

    def _hear(self, sampled: list[SensorReading]) -> None:
        for one in sampled:
            if one.stream in self._lately:
                self._newest_s[one.stream] = one.time_s
                if math.isinf(self._since_s):
                    self._since_s = one.time_s
                self._lately[one.stream].add(one.time_s, one.values)


def swapping(session: LiveSession, streams: Sequence[str], now_ns: int) -> list[Packet]:
    """The commands that give each of two streams the device that feeds the other.

    Raises:
        DataError: they cannot be exchanged in the session.
    """
    feeding = session.intake.feeding()
    units = [feed.stream for feed in session.rig.feeds if feed.kind == "imu"]
    if len(set(streams)) != 2 or not set(streams) <= {*units} & {*feeding}:
        raise DataError(
            f"two inertial units that send are exchanged, not {', '.join(map(str, streams))[:80]}"
        )
    one, other = streams
    if feeding[one].source != feeding[other].source:
        raise DataError(f"{one} and {other} come from different sources: exchange the units on the body")
    return [
        command(now_ns, "assign", stream=stream, device=feeding[source].name)
        for stream, source in ((one, other), (other, one))
    ]


def _pool() -> ProcessPoolExecutor:
    """A process that computes on one core, so that the others are the tracker's and the browser's."""
    with _one_thread():
        pool = child_pool()
        pool.submit(prepared)
    return pool


@contextmanager
def _one_thread() -> Iterator[None]:
    """What is started here does its linear algebra on one core: matrices are small."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
