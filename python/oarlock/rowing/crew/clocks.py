"""Brings the clocks of several loggers together, and says how well: `crew_clocks`, for `crew_timing`.

A difference of clocks looks exactly like a difference of timing, so nothing is assumed: either the loggers are one, or
something that all of them measured agrees, or somebody says how well they were synchronised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.rowing.crew.common_motion import NoCommonMotion, common_motion
from oarlock.rowing.crew.matching import aligning_shift
from oarlock.rowing.crew.seats import CrewSeat
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import apart_s
from oarlock.storage.errors import DataError


@dataclass(frozen=True)
class SeatClock:
    """How a seat's stamps become times of the leading seat's clock: ``t - offset_s - drift * t``.

    Attributes:
        offset_s, drift: of the seat's clock; positive if its stamps are late, or it is fast.
        std_s: standard deviation of the offset in the middle of the piece, s; 0 on one logger, NaN if not known.
    """

    offset_s: float = 0.0
    drift: float = 0.0
    std_s: float = 0.0

    def leading_s(self, time_s: Floats) -> Floats:
        """Times (N,) of the leading seat's clock, s, for the seat's own stamps."""
        return np.asarray(time_s - self.offset_s - self.drift * time_s, dtype=np.float64)

    def own_s(self, time_s: Floats) -> Floats:
        """The opposite of `leading_s`, (N,) s."""
        return np.asarray((time_s + self.offset_s) / (1.0 - self.drift), dtype=np.float64)


@dataclass(frozen=True)
class CrewClocks:
    """The clocks of all seats.

    Attributes:
        kind: ``one`` logger, ``hull`` (the boat's own unit on each), ``given`` (said by a person) or ``unknown``.
        seats: one each, in the order of the seats.
        sentence: what that means for timing, for people.
        why: why nothing better is known; "" where the clocks are known.
    """

    kind: str
    seats: tuple[SeatClock, ...]
    sentence: str
    why: str = ""

    @property
    def known(self) -> bool:
        """Whether timing between seats can be told from an error of the clocks."""
        return self.kind != "unknown"

    @property
    def worst_std_s(self) -> float:
        """The largest standard deviation of a seat's offset, s; NaN if the clocks are not known."""
        return max(clock.std_s for clock in self.seats) if self.known else float("nan")


def crew_clocks(seats: Sequence[CrewSeat], leader: int, std_s: float | None = None) -> CrewClocks:
    """The clocks of a crew's loggers relative to that of seat number `leader`.

    Args:
        seats: from `crew_seats`.
        leader: place of the seat whose clock counts.
        std_s: what a person knows: 0 if one logger recorded all seats, else how well two loggers were synchronised
            (standard deviation, s). None finds it: one logger, then the boat's unit.

    Raises:
        DataError: `std_s` is negative, or some moments of start are known and others are not.
    """
    if std_s is not None and not 0.0 <= std_s <= 1.0:
        raise DataError(f"clocks: a standard deviation of {std_s:g} s; give 0 (one logger) to 1 s")
    starts = _starts(seats, leader)
    if std_s == 0.0 or (std_s is None and _one_logger(seats)):
        stated = "" if std_s is None else ", as stated"
        text = f"One logger recorded all seats{stated}: clocks add no error."
        return CrewClocks("one", _apart(starts, 0.0), text)
    if std_s is not None:
        text = (
            f"The loggers were synchronised to {1e3 * std_s:.3g} ms (SD), as stated; the bands contain this."
        )
        return CrewClocks("given", _apart(starts, std_s, leader), text)
    return _measured(seats, leader, starts)


def _starts(seats: Sequence[CrewSeat], leader: int) -> list[float]:
    """How much later than the leader's each seat's 0 s is, s; 0 if no moment is known."""
    known = [seat.epoch is not None for seat in seats]
    if not any(known):
        return [0.0] * len(seats)
    found = [apart_s(seat.epoch, seats[leader].epoch) for seat in seats]
    if any(one is None for one in found):
        without = ", ".join(seat.label for seat, one in zip(seats, found, strict=True) if one is None)
        raise DataError(
            f"crew: the moment of 0 s is known of some seats and not of {without} (or in another time zone). "
            f"Export all "
            "seats with or all without the time of day"
        )
    return [float(one) for one in found if one is not None]


def _apart(starts: Sequence[float], std_s: float, leader: int = -1) -> tuple[SeatClock, ...]:
    return tuple(SeatClock(-start, 0.0, 0.0 if k == leader else std_s) for k, start in enumerate(starts))


def _one_logger(seats: Sequence[CrewSeat]) -> bool:
    """Whether `session.toml` names one logger, or the stamps are identical to the bit and begin at one known moment."""
    loggers = {seat.session.get("logger", "") for seat in seats}
    if len(loggers) == 1 and loggers != {""}:
        return True
    if len(loggers - {""}) > 1 or None in {seat.epoch for seat in seats}:
        return False
    stamps = [_stamps(seat) for seat in seats]
    return len({seat.epoch for seat in seats}) == 1 and bool(set.intersection(*stamps))


def _stamps(seat: CrewSeat) -> set[bytes]:
    return {stream.time_s.tobytes() for stream in seat.recording.streams} if seat.recording else set()


def _measured(seats: Sequence[CrewSeat], leader: int, starts: Sequence[float]) -> CrewClocks:
    clocks: list[SeatClock] = []
    reasons: dict[str, list[str]] = {}
    for k, seat in enumerate(seats):
        if k == leader:
            clocks.append(SeatClock())
            continue
        try:
            clocks.append(_by_hull(seats[leader], seat, starts[k]))
        except NoCommonMotion as error:
            reasons.setdefault(str(error), []).append(seat.label)
    if not reasons:
        worst = 1e3 * max(clock.std_s for clock in clocks)
        text = (
            f"The boat's own unit on each logger aligns them to {worst:.2g} ms (SD); the bands contain this."
        )
        return CrewClocks("hull", tuple(clocks), text)
    shifted = [
        SeatClock() if k == leader else _by_strokes(seats[leader], seat, starts[k])
        for k, seat in enumerate(seats)
    ]
    text = (
        "How well the loggers' clocks agree is not known, so who is early and who is late cannot be told from "
        "an error of "
        "the clocks. How evenly each seat follows can."
    )
    return CrewClocks(
        "unknown", tuple(shifted), text, "; ".join(f"{', '.join(who)}: {why}" for why, who in reasons.items())
    )


def _by_hull(leader: CrewSeat, seat: CrewSeat, start_s: float) -> SeatClock:
    if leader.recording is None or seat.recording is None:
        raise NoCommonMotion("the readings behind the track are not at hand")
    known = leader.epoch is not None
    offset, drift, std = common_motion(leader.recording, seat.recording, -start_s, 5.0 if known else None)
    return SeatClock(offset, drift, std)


def _by_strokes(leader: CrewSeat, seat: CrewSeat, start_s: float) -> SeatClock:
    shift = aligning_shift(leader.catch_s, seat.catch_s + start_s)
    return SeatClock(-(start_s + shift), 0.0, float("nan"))
