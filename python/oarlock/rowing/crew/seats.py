"""`CrewSeat`: one seat of a boat with its strokes, and `crew_seats`, which names, orders and checks the seats."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from oarlock import Recording, Track
from oarlock.rowing.strokes.events import Event
from oarlock.rowing.strokes.find_strokes import find_strokes
from oarlock.rowing.strokes.signals import SOURCES
from oarlock.rowing.strokes.strokes import Strokes
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_BOW, _STROKE = 1.0, 1000.0
_SESSION = "session"


@dataclass(frozen=True, eq=False)
class CrewSeat:
    """A seat with the turning points of its movement, on the clock of its own logger.

    Attributes:
        name: ``bow``, ``2``, ``3`` ... ``stroke``.
        data: the track or recording.
        strokes: all of it.
        catch_s, finish_s: (N,) times at which the movement reverses, s from `epoch`, of the strokes that count.
        catch_std_s, finish_std_s: (N,) standard deviations of the measurement, s.
        session: who and when, see `session.toml`.
        recording: the readings behind a track, with the boat's own unit, if they are at hand.
    """

    name: str
    data: Track | Recording
    strokes: Strokes
    catch_s: Floats
    finish_s: Floats
    catch_std_s: Floats
    finish_std_s: Floats
    session: Mapping[str, str]
    recording: Recording | None = None

    @property
    def epoch(self) -> str | None:
        """The moment of 0 s, as `Recording.epoch`."""
        return self.data.epoch

    @property
    def label(self) -> str:
        """For people: "stroke", "seat 3"."""
        return f"seat {self.name}" if self.name.isdigit() else self.name


def seat_place(name: str) -> float:
    """Where a seat is, counted from the bow: 1 for bow, a large number for stroke.

    Raises:
        DataError: the name is neither bow, stroke nor a number.
    """
    plain = re.sub(r"^seat\s*", "", name.strip().lower())
    if plain in ("bow", "b"):
        return _BOW
    if plain in ("stroke", "str"):
        return _STROKE
    if plain.isdigit() and 1 <= int(plain) <= 24:
        return float(plain)
    raise DataError(f'seat "{name}": is no seat. Name it bow, 2, 3 ... or stroke; bow is seat 1')


def crew_seats(
    pieces: Sequence[Track | Recording],
    names: Sequence[str] | None = None,
    recordings: Sequence[Recording | None] | None = None,
    source: str | None = None,
) -> list[CrewSeat]:
    """The seats of a boat from bow to stroke, each with its strokes.

    Args:
        pieces: a track or a recording of each seat.
        names: the seats; None takes ``seat`` of each `session.toml`.
        recordings: of each track, for the clocks (`crew_timing`); not needed where `pieces` are recordings.
        source: the movement to compare, see `find_strokes`; None takes the first that all seats have.

    Raises:
        DataError: less than two seats, a seat without a name or twice, different boats, or no movement that all have.
    """
    if len(pieces) < 2:
        raise DataError(f"a crew needs at least two seats; got {len(pieces)}. Give a folder of each seat")
    sessions = [_session(piece) for piece in pieces]
    named = _names(sessions, names)
    _one_boat(sessions, named)
    known = recordings if recordings is not None else [None] * len(pieces)
    given = [one if one is not None else _readings(piece) for one, piece in zip(known, pieces, strict=True)]
    found = _same_movement(pieces, named, source)
    seats = [_seat(*one) for one in zip(named, pieces, found, sessions, given, strict=True)]
    return sorted(seats, key=lambda seat: seat_place(seat.name))


def _readings(piece: Track | Recording) -> Recording | None:
    return piece if isinstance(piece, Recording) else None


def _session(piece: Track | Recording) -> Mapping[str, str]:
    about = piece.meta if isinstance(piece, Recording) else piece.provenance
    found = about.get(_SESSION)
    plain = {str(k): str(v) for k, v in found.items()} if isinstance(found, Mapping) else {}
    if "athlete" not in plain and isinstance(about.get("athlete"), str):
        plain["athlete"] = str(about["athlete"])
    return plain


def _names(sessions: Sequence[Mapping[str, str]], names: Sequence[str] | None) -> list[str]:
    if names is not None and len(names) != len(sessions):
        raise DataError(f"{len(names)} seats are named, but {len(sessions)} pieces are given. Name each once")
    told = list(names) if names is not None else [session.get("seat", "") for session in sessions]
    for place, name in enumerate(told):
        if not name:
            raise DataError(
                f"piece {place + 1} of {len(told)}: its session.toml names no seat. Name the seats with --seats "
                'bow,2,3,stroke in the order of the folders, or write seat = "3" into session.toml'
            )
    places = [seat_place(name) for name in told]
    for place, name in enumerate(told):
        if places.index(places[place]) != place:
            raise DataError(f'seat "{name}" is given twice. Each seat of a boat has one piece')
    return [_shown(place) for place in places]


def _shown(place: float) -> str:
    return {_BOW: "bow", _STROKE: "stroke"}.get(place, f"{place:.0f}")


def _one_boat(sessions: Sequence[Mapping[str, str]], names: Sequence[str]) -> None:
    boats = {
        session["boat"]: name for session, name in zip(sessions, names, strict=True) if "boat" in session
    }
    if len(boats) > 1:
        each = ", ".join(f'"{boat}" ({name})' for boat, name in boats.items())
        raise DataError(f"the pieces are of different boats: {each}. Give the seats of one boat")


def _same_movement(
    pieces: Sequence[Track | Recording], names: Sequence[str], source: str | None
) -> list[Strokes]:
    """Strokes of all seats from one kind of movement: seats and oars do not reverse at the same time."""
    tried, missing = (SOURCES if source is None else (source,)), {}
    for kind in tried:
        try:
            found = [find_strokes(piece, source=kind) for piece in pieces]
        except DataError as error:
            missing[kind] = str(error)
            continue
        empty = [name for name, strokes in zip(names, found, strict=True) if not strokes.in_averages.any()]
        if not empty:
            return found
        missing[kind] = f"no counted stroke of {', '.join(empty)}"
    raise DataError(
        f"crew: no movement that all seats have ({'; '.join(f'{kind}: {why}' for kind, why in missing.items())}). "
        "Timing is compared between equal movements only: oars with oars, seat with seat"
    )


def _seat(
    name: str,
    piece: Track | Recording,
    strokes: Strokes,
    session: Mapping[str, str],
    recording: Recording | None,
) -> CrewSeat:
    rows = [stroke for stroke, good in zip(strokes.strokes, strokes.in_averages, strict=True) if good]
    catch = np.array([_turn([s.catch for s in stroke.sides.values()]) for stroke in rows])
    finish = np.array([_turn([s.finish for s in stroke.sides.values()]) for stroke in rows])
    return CrewSeat(
        name,
        piece,
        strokes,
        catch[:, 0],
        finish[:, 0],
        catch[:, 1],
        finish[:, 1],
        session,
        recording,
    )


def _turn(events: Sequence[Event]) -> tuple[float, float]:
    """When the movement reversed, mean of two oars, and its standard deviation, s.

    Not `Event.time_s`: for a seat that is the catch of the handle, which is known to 25 ms only. The reversals of two
    seats compare without it.
    """
    std = float(np.sqrt(sum(event.reversal.time_std_s**2 for event in events))) / len(events)
    return float(np.mean([event.reversal.time_s for event in events])), std
