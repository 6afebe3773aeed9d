"""A device's clock against this machine's, from arrivals: used after 0.4 s, slewed, never stepped while it runs on.

A reading whose delay fits the line of the least delays (`Envelope`) has its time at once. One that is off by more than
`RESTART_S` is held back until the next ones show why: the device's clock was set, or the reading is only late. Late
readings keep the times at which they were measured, and none is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

from oarlock.live.envelope import Envelope

SETTLE_S, SETTLE_READINGS = 0.4, 8
"""The least delay of so much time and so many readings is the first offset. A tracker can go back by 0.5 s."""
LONGEST_SETTLE_S = 2.0
"""The same for readings that are rare."""
SLEW, LARGEST_SLEW, SLEW_S = 1e-3, 2e-2, 3.0
"""The offset in use moves by `SLEW` a second, or by its drift and what is left in `SLEW_S` if that is more, up to
`LARGEST_SLEW`: above any drift, and below what a movement shows."""
RESTART_S = 0.25
"""Readings that are off by more are late, or the clock was set."""
STAY_S, SAME_S = 1.0, 0.05
"""Readings whose least delay stays the same for so long, to so much, are not late: the device's clock paused."""
BACK_S = 1.0
"""Readings may overtake each other by less; stamps that jump back by more are those of a clock that was set."""
SURE = 3
"""So many readings in a row that agree show that a clock was set; a single one may be damaged."""

T = TypeVar("T")


class Heard(NamedTuple, Generic[T]):
    """A reading as it was received.

    Args:
        clock_s: the device's stamp.
        arrival_s: by this machine's clock.
        what: was measured.
    """

    clock_s: float
    arrival_s: float
    what: T

    @property
    def delay_s(self) -> float:
        """Arrival minus stamp."""
        return self.arrival_s - self.clock_s


def _no() -> bool:
    return False


@dataclass
class DeviceClock(Generic[T]):
    """Turns a device's stamps into seconds of this machine; the same readings give the same bits.

    Args:
        are_others_late: whether the readings of all other senders are late at this time, too. If so this machine was
            held up, and no clock paused.
        envelope: of the delays.
    """

    are_others_late: Callable[[], bool] = _no
    envelope: Envelope = field(default_factory=Envelope)
    restarts: int = 0
    """How often the device's clock was set or started again."""
    is_late: bool = False
    """Whether the last reading came much later than usual."""
    _offset_s: float | None = None
    _used_at_s: float = 0.0
    _began_clock_s: float = 0.0
    _last: Heard[T] | None = None
    _held: list[Heard[T]] = field(default_factory=list)

    @property
    def offset_s(self) -> float | None:
        """What is added to the device's stamps now, s; None until the clock has settled."""
        return self._offset_s

    @property
    def drift(self) -> float:
        """By how much the device's clock is slow, as a ratio: 50e-6 is 50 ppm."""
        return self.envelope.drift

    def take(self, clock_s: float, arrival_s: float, what: T) -> list[tuple[T, float]]:
        """Takes a reading, and gives all whose times are known now, in the order in which they came.

        Args:
            clock_s: the device's stamp, s, unwrapped.
            arrival_s: when the reading was received, s, by this machine's monotonic clock.
            what: was measured.

        Returns:
            What was measured, and when by this machine's clock, s.
        """
        one = Heard(clock_s, arrival_s, what)
        if self._offset_s is None:
            return self._settle(one)
        off_s = one.delay_s - self.envelope.offset_s(arrival_s)
        self.is_late = off_s > RESTART_S
        if abs(off_s) > RESTART_S:
            return self._doubt(one)
        self._last = one
        self.envelope.see(arrival_s, one.delay_s)
        self._slew(arrival_s)
        return [*self._release(), *self._timed([one])]

    def flush(self) -> list[tuple[T, float]]:
        """Gives the readings that are held back; they are taken for late ones."""
        if self._offset_s is not None:
            return self._release()
        held, self._held = self._held, []
        return _by_least(held)

    def _settle(self, one: Heard[T]) -> list[tuple[T, float]]:
        """Holds readings back until the first offset is known."""
        found: list[tuple[T, float]] = []
        if self._held and _is_set(self._held[-1], one):
            found = _by_least(self._held)
            self.restarts += 1
            self._held = []
        self._held.append(one)
        lasts_s = one.arrival_s - self._held[0].arrival_s
        if lasts_s < LONGEST_SETTLE_S and (lasts_s < SETTLE_S or len(self._held) < SETTLE_READINGS):
            return found
        self.envelope.begin((h.arrival_s, h.delay_s) for h in self._held)
        self._offset_s, self._used_at_s = self.envelope.offset_s(one.arrival_s), one.arrival_s
        self._began_clock_s = min(h.clock_s for h in self._held)
        self._last = one
        self.is_late = False
        return [*found, *self._release()]

    def _release(self) -> list[tuple[T, float]]:
        """What was held back and is only late. A stamp that is too early for its arrival is damaged."""
        held, self._held = self._held, []
        return self._timed(h for h in held if self._can_be_late(h))

    def _can_be_late(self, one: Heard[T]) -> bool:
        early_s = self.envelope.offset_s(one.arrival_s) - one.delay_s
        return early_s <= RESTART_S and one.clock_s >= self._began_clock_s

    def _timed(self, heard: Iterable[Heard[T]]) -> list[tuple[T, float]]:
        assert self._offset_s is not None
        return [(h.what, h.clock_s + self._offset_s) for h in heard]

    def _doubt(self, one: Heard[T]) -> list[tuple[T, float]]:
        """Holds a reading back that does not fit; or says what it and those before it show."""
        assert self._last is not None
        self._held.append(one)
        newest = self._held[-SURE:]
        if self._are_set(newest):
            return self._restart(self._held[:-SURE], newest)
        if not self.is_late or self._is_back(one):
            return []
        if self.are_others_late():
            return self._release()
        if one.arrival_s - self._held[0].arrival_s < STAY_S or len(self._held) < SURE:
            return []
        return self._restart([], self._held) if _stays(self._held) else self._release()

    def _is_back(self, one: Heard[T]) -> bool:
        return self._last is not None and one.clock_s < self._last.clock_s - BACK_S

    def _are_set(self, newest: list[Heard[T]]) -> bool:
        """Whether these show by themselves that the clock was set: back, or ahead of what a reading can be."""
        delays = [h.delay_s for h in newest]
        if len(newest) < SURE or max(delays) - min(delays) > RESTART_S:
            return False
        ahead = all(h.delay_s < self.envelope.offset_s(h.arrival_s) - RESTART_S for h in newest)
        return ahead or all(self._is_back(h) for h in newest)

    def _restart(self, old: list[Heard[T]], new: list[Heard[T]]) -> list[tuple[T, float]]:
        """Begins a segment with the new ones; those that were held back before them are late."""
        assert self._last is not None
        # Readings that were late from the start make later ones look early; but their stamps run on.
        if self.is_late or _is_set(self._last, new[0]):
            self.restarts += 1
        self._held = old
        found = self._release()
        self._offset_s = None
        for one in new:
            found += self._settle(one)
        return found

    def _slew(self, arrival_s: float) -> None:
        assert self._offset_s is not None
        left_s = self.envelope.offset_s(arrival_s) - self._offset_s
        slew = min(max(abs(left_s) / SLEW_S + abs(self.drift), SLEW), LARGEST_SLEW)
        room_s = slew * max(arrival_s - self._used_at_s, 0.0)
        self._offset_s += min(max(left_s, -room_s), room_s)
        self._used_at_s = max(arrival_s, self._used_at_s)


def _by_least(held: Sequence[Heard[T]]) -> list[tuple[T, float]]:
    """Times of readings that nothing but themselves can time."""
    least_s = min((h.delay_s for h in held), default=0.0)
    return [(h.what, h.clock_s + least_s) for h in held]


def _is_set(last: Heard[T], one: Heard[T]) -> bool:
    """Whether the stamps jump from one reading to the next."""
    step_s = one.clock_s - last.clock_s
    return step_s < -BACK_S or step_s - max(one.arrival_s - last.arrival_s, 0.0) > RESTART_S


def _stays(late: Sequence[Heard[T]]) -> bool:
    """Whether the least delay is the same in both halves. Where queues fill and empty it is not."""
    middle_s = 0.5 * (late[0].arrival_s + late[-1].arrival_s)
    first = min(h.delay_s for h in late if h.arrival_s <= middle_s)
    second = min(h.delay_s for h in late if h.arrival_s > middle_s)
    return abs(second - first) < SAME_S
