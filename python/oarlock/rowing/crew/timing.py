"""`crew_timing`: how much earlier or later each seat of a boat catches and finishes, with bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from oarlock.rowing.crew.clocks import CrewClocks, crew_clocks
from oarlock.rowing.crew.matching import matched
from oarlock.rowing.crew.scatter import Mean, mean_of
from oarlock.rowing.crew.seats import CrewSeat, seat_place
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

EVENTS = ("catch", "finish", "drive")
"""Of each stroke: the times of catch and finish, and the time between them, which no clock can falsify."""
FLOOR_S = 0.001
"""Standard deviation of what all strokes of a seat share beside the clock, s: filters and stamps of its sensors.
Measured on simulated crews, see docs/crew.md."""
BAND = 0.95


@dataclass(frozen=True)
class Delay:
    """How much later than the reference a seat is at one event; negative if it is earlier.

    Attributes:
        seat: name of the seat.
        event: ``catch``, ``finish`` or ``drive`` (how much longer the drive takes).
        strokes: mean and scatter over the strokes, s.
        systematic_s: standard deviation of what all strokes share, s; NaN if the clocks are not known.
    """

    seat: str
    event: str
    strokes: Mean
    systematic_s: float

    @property
    def mean_s(self) -> float:
        """The mean, s; NaN if the clocks are not known, or with too few strokes."""
        return self.strokes.mean if np.isfinite(self.systematic_s) else float("nan")

    @property
    def half_width_s(self) -> float:
        """Half of the 95 % band of the mean, s."""
        return self.strokes.half_width(BAND, self.systematic_s)

    @property
    def low_s(self) -> float:
        """Lower end of the 95 % band, s."""
        return self.mean_s - self.half_width_s

    @property
    def high_s(self) -> float:
        """Upper end of the 95 % band, s."""
        return self.mean_s + self.half_width_s


@dataclass(frozen=True, eq=False)
class CrewTiming:
    """The timing of a crew.

    Attributes:
        seats: from bow to stroke.
        leader: place of the seat whose strokes are the rows; the stroke seat, if it is there.
        against: what `late_s` refers to: the name of a seat, or ``crew mean``.
        clocks: of the loggers.
        catch_s, end_s: (N,) s of the leader's clock: its catches, and its next ones (NaN after the last).
        late_s: by event, (N, seats) s later than the reference; NaN where a seat has no such stroke. If the
            clocks are not
            known, catch and finish are relative to the seat's own mean, without drift.
        late_std_s: standard deviations of the measurement, (N, seats) s.
        delays: of each seat but the reference, and event.
        first_share: (seats,) share of the strokes in which the seat catches first, of those that all seats have.
        left_out: strokes of the leader that not all seats have.
    """

    seats: tuple[CrewSeat, ...]
    leader: int
    against: str
    clocks: CrewClocks
    catch_s: Floats
    end_s: Floats
    late_s: Mapping[str, Floats]
    late_std_s: Mapping[str, Floats]
    delays: tuple[Delay, ...]
    first_share: Floats
    left_out: int

    def delay(self, seat: str, event: str) -> Delay | None:
        """That of a seat and event; None of the reference."""
        return next((one for one in self.delays if (one.seat, one.event) == (seat, event)), None)

    @property
    def source(self) -> str:
        """The movement that was compared, as `Strokes.source`."""
        return self.seats[self.leader].strokes.source

    @property
    def complete(self) -> Bools:
        """(N,) strokes that all seats have."""
        return np.asarray(np.isfinite(self.late_s["catch"]).all(axis=1))


def crew_timing(
    seats: Sequence[CrewSeat], against: str | None = None, clock_std_s: float | None = None
) -> CrewTiming:
    """Compare catch and finish of several seats, stroke by stroke.

    Strokes belong together if their catches are each other's nearest, see `crew.matching`. A mean counts each stroke
    by its uncertainty; its band contains scatter of strokes (and that neighbours resemble each other), the
    measurement, and the clocks.

    Args:
        seats: from `crew_seats`.
        against: the seat to compare with, or ``mean`` of the crew; None: the stroke seat, or the seat nearest to it.
        clock_std_s: as `crew_clocks`.

    Raises:
        DataError: there is no such seat, no two strokes belong together, or the clocks are stated wrongly.
    """
    leader = _leader(seats, against)
    clocks = crew_clocks(seats, leader, clock_std_s)
    late, std = _late(seats, leader, clocks)
    rows = np.flatnonzero(np.isfinite(late["catch"]).sum(axis=1) > 1)
    if len(rows) == 0:
        raise DataError(
            "crew: no two strokes belong together. Are these the same piece? Times are compared by the moment of 0 s "
            "(epoch); check the clocks of the loggers"
        )
    catch = seats[leader].catch_s[rows]
    late = {event: values[rows] for event, values in late.items()}
    std = {event: values[rows] for event, values in std.items()}
    if not clocks.known:
        late = _centred(catch, late)
    first = _first_share(late["catch"]) if clocks.known else np.full(len(seats), np.nan)
    mean = against == "mean"
    if mean:
        late = _against_mean(late)
    delays = [
        _delay(seat.name, event, late[event][:, k], std[event][:, k], clocks, k, leader)
        for k, seat in enumerate(seats)
        for event in EVENTS
        if mean or k != leader
    ]
    return CrewTiming(
        tuple(seats),
        leader,
        "crew mean" if mean else seats[leader].name,
        clocks,
        catch,
        _ends(seats[leader])[rows],
        MappingProxyType(late),
        MappingProxyType(std),
        tuple(delays),
        first,
        len(seats[leader].catch_s) - int(np.isfinite(late["catch"]).all(axis=1).sum()),
    )


def _leader(seats: Sequence[CrewSeat], against: str | None) -> int:
    if against in (None, "mean"):
        return len(seats) - 1
    assert against is not None
    place = seat_place(against)
    for k, seat in enumerate(seats):
        if seat_place(seat.name) == place:
            return k
    raise DataError(
        f'"{against}" is no seat of this crew; there are {", ".join(seat.name for seat in seats)}, and mean'
    )


def _late(
    seats: Sequence[CrewSeat], leader: int, clocks: CrewClocks
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Each seat's events minus the leader's, (N, seats), and what the measurement may be off by."""
    first = seats[leader]
    shape = (len(first.catch_s), len(seats))
    late = {event: np.full(shape, np.nan) for event in EVENTS}
    std = {event: np.full(shape, np.nan) for event in EVENTS}
    for k, (seat, clock) in enumerate(zip(seats, clocks.seats, strict=True)):
        catch, finish = clock.leading_s(seat.catch_s), clock.leading_s(seat.finish_s)
        theirs, own = matched(first.catch_s, catch)
        values = {"catch": catch[own] - first.catch_s[theirs], "finish": finish[own] - first.finish_s[theirs]}
        noise = {
            "catch": np.hypot(seat.catch_std_s[own], first.catch_std_s[theirs]),
            "finish": np.hypot(seat.finish_std_s[own], first.finish_std_s[theirs]),
        }
        values["drive"] = values["finish"] - values["catch"]
        noise["drive"] = np.hypot(noise["catch"], noise["finish"])
        for event in EVENTS:
            late[event][theirs, k] = values[event]
            std[event][theirs, k] = noise[event] if k != leader else 0.0
    return late, std


def _centred(catch_s: Floats, late: Mapping[str, Floats]) -> dict[str, Floats]:
    """Without a clock's offset and drift, which would look like them: a line through each seat's delays."""
    found = {event: values.copy() for event, values in late.items()}
    for event in ("catch", "finish"):
        for k in range(found[event].shape[1]):
            column = found[event][:, k]
            good = np.isfinite(column)
            if good.sum() > 2:
                line = np.polyfit(catch_s[good] - catch_s[0], column[good], 1)
                column[good] -= np.polyval(line, catch_s[good] - catch_s[0])
    return found


def _against_mean(late: Mapping[str, Floats]) -> dict[str, Floats]:
    """Minus the mean of all seats, of the strokes that all have: with a seat missing the mean would be another."""
    return {event: values - values.mean(axis=1, keepdims=True) for event, values in late.items()}


def _first_share(late_s: Floats) -> Floats:
    whole = late_s[np.isfinite(late_s).all(axis=1)]
    if not len(whole):
        return np.full(late_s.shape[1], np.nan)
    return np.bincount(np.argmin(whole, axis=1), minlength=late_s.shape[1]) / len(whole)


def _delay(
    seat: str, event: str, late_s: Floats, std_s: Floats, clocks: CrewClocks, place: int, leader: int
) -> Delay:
    clock = 0.0 if event == "drive" else clocks.seats[place].std_s
    if place == leader and event != "drive":
        # against the mean: the others' clocks are in it
        clock = clocks.worst_std_s if len(clocks.seats) > 1 else 0.0
    return Delay(seat, event, mean_of(late_s, std_s), float(np.hypot(clock, FLOOR_S)))


def _ends(seat: CrewSeat) -> Floats:
    """The next catch of each counted stroke, (N,) s."""
    ends = np.append(seat.catch_s[1:], np.nan)
    cycle = float(np.median(np.diff(seat.catch_s))) if len(seat.catch_s) > 1 else np.nan
    return np.where(ends - seat.catch_s < 1.5 * cycle, ends, np.nan)
