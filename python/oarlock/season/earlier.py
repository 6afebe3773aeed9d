"""`earlier_pieces`: last time and own best of an athlete in a season, for the report of a track."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from oarlock import Calibration, Model, ModelError, Track
from oarlock.recording.session_info import session_info
from oarlock.report import day_text
from oarlock.rowing.findings.rowed import kind_of
from oarlock.rowing.report.stored_piece import StoredPiece
from oarlock.rowing.strokes.files import parsed_strokes
from oarlock.season.add import start_of
from oarlock.season.comparable import Compared, end_of, is_day, mounts_differ
from oarlock.season.efforts import Efforts
from oarlock.season.layout import STROKES_FILE, result_folder
from oarlock.season.questions.database import Database
from oarlock.season.questions.selection import Selection
from oarlock.season.run.setups import opened_setup
from oarlock.season.store import Season
from oarlock.storage.errors import DataError

AS_LONG = 0.9
"""An own best has at least so many counted strokes, relative to the piece: shorter pieces are rowed faster."""
RATES_ALIKE = 1.0
"""Largest difference of usual rates for an own best, 1/min: power and speed follow the rate."""
_MOST_NAMED = 3


class EarlierPieces(NamedTuple):
    """Pieces of the same athlete to compare with; `notes` say which they are and why, in plain sentences."""

    last: StoredPiece | None = None
    best: StoredPiece | None = None
    notes: tuple[str, ...] = ()


def earlier_pieces(
    season: Season,
    track: Track,
    names: Mapping[str, str] | None = None,
    *,
    last: bool = True,
    best: bool = True,
) -> EarlierPieces:
    """Last time and own best of a track's athlete, among the pieces that ended before the track began.

    Comparable are pieces of the same kind of boat or ergometer, whose strokes come from the same signal, whose usual
    rates differ by at most `RATES_APART`, which the same version of Oarlock computed, and which were calibrated if
    the track was. Last time is the latest of them. The own best is the one with the highest mean boat speed
    (ergometer: power) that a device's export of the same time in the season contains, among those at the same rate
    (`RATES_ALIKE`) with at least `AS_LONG` as many counted strokes; without such an export none is claimed.

    Args:
        season: where; its tables are brought up to date.
        track: of a rower; its session says whose it is and, without an epoch, on which day it was rowed.
        names: pseudonym by name, if the track's session has a name.
        last: whether last time is looked for.
        best: whether the own best is looked for.

    Returns:
        EarlierPieces: what is missing is None, and a note says why.

    Raises:
        DataError: DuckDB is not installed, or the session's date is none.
    """
    asked = _asked(season, track, names or {})
    if isinstance(asked, str):
        return EarlierPieces(notes=(f'Not compared with the season "{season.name}": {asked}',))
    now, pseudonym = asked
    with Database(season, Selection(athlete=pseudonym)) as database:
        rows = [row for row in _rows(database) if now.follows(row)]
        efforts = Efforts.of(database, now.rowed.kind) if best and rows else None
    if not rows:
        return EarlierPieces(
            notes=(f'Not compared: the season "{season.name}" has no earlier piece of this athlete.',)
        )
    search = _Search(now, rows)
    found, notes = search.last() if last else (None, [])
    record, more = (None, []) if efforts is None else search.best(efforts, found)
    return EarlierPieces(found, record, (*notes, *more))


def _asked(season: Season, track: Track, names: Mapping[str, str]) -> tuple[Compared, str] | str:
    """The piece and the pseudonym of its athlete, or why there is nothing to look for."""
    info = session_info(track.provenance)
    person = info.get("athlete", "")
    if not person:
        return 'the track does not say whose it is. Write athlete = "..." into its session.toml.'
    pseudonym = names.get(person, person)
    if season.athlete(pseudonym) is None or season.is_erased_now(pseudonym):
        hint = "" if names else " If it knows the athlete by a pseudonym, give the file of names (--names)."
        return f"it contains nothing of {person}.{hint}"
    start = start_of(season, track.provenance.get("epoch"), float(track.time_s[0]), info)
    if start is None:
        return 'the date of this piece is not known. Write date = "2026-05-01" into its session.toml.'
    try:
        now = Compared.of(season, track, start)
    except DataError as error:
        return f"no strokes were found in this piece: {error}"
    return (now, pseudonym) if len(now.rowed.numbers) else "no stroke of this piece counts in averages."


class _Search:
    """Looks among the earlier recordings of the athlete, the latest first."""

    def __init__(self, now: Compared, rows: Sequence[Mapping[str, Any]]) -> None:
        self.now, self.rows = now, rows
        self._setup = cache(self._opened)
        self._looked: dict[str, StoredPiece | str] = {}

    def last(self) -> tuple[StoredPiece | None, list[str]]:
        """The latest that compares, and notes."""
        passed: list[str] = []
        for row in self.rows:
            found = self.piece(row)
            if isinstance(found, StoredPiece):
                rule = "the latest earlier piece of the same kind, signal and about the same rate"
                return found, [
                    f"Last time: {found.name}; {rule} in the season.",
                    *_passed(passed, "Later, but not compared"),
                ]
            passed.append(f"{self._when(row)} {found}")
        return None, ["Last time: no earlier piece in the season compares.", *_passed(passed, "Not compared")]

    def best(self, efforts: Efforts, last: StoredPiece | None) -> tuple[StoredPiece | None, list[str]]:
        """The fastest at this rate, and notes; None if it is last time's."""
        speed = efforts.measure == "speed_m_s"
        what, digits, unit = ("boat speed", 2, "m/s") if speed else ("power", 0, "W")
        rule = (
            f"the highest mean {what} at this rate (within {RATES_ALIKE:.0f}/min) "
            f"and at least {100.0 * AS_LONG:.0f} % as many strokes"
        )
        known = [
            (value, row)
            for row in self.rows
            if self._alike(row) and (value := self._effort(efforts, row)) > 0.0
        ]
        for value, row in sorted(known, key=lambda one: -one[0]):
            found = self.piece(row)
            if isinstance(found, StoredPiece):
                same = " It is last time's piece." if found is last else ""
                wind = " Wind and stream are not removed." if speed else ""
                said = f"Own best: {found.name}, {value:.{digits}f} {unit}; {rule} among earlier pieces.{wind}{same}"
                return (None if same else found), [said]
        return None, [
            f"Own best: none is claimed. It would be {rule}; the season has no such earlier piece with "
            "a device's export of the same time (`oarlock season add`)."
        ]

    def piece(self, row: Mapping[str, Any]) -> StoredPiece | str:
        """The piece, or why it does not compare."""
        name = row["recording"]
        if name not in self._looked:
            self._looked[name] = self.now.differs(row) or self._read(row)
        return self._looked[name]

    def _read(self, row: Mapping[str, Any]) -> StoredPiece | str:
        setup = self._setup(row["setup"])
        if setup is None:
            return "has a setup that cannot be read: `oarlock season check`"
        model, calibration = setup
        if (kind := kind_of(model.joint_names)) != self.now.rowed.kind:
            return f"is {kind}, this piece {self.now.rowed.kind}"
        if told := mounts_differ(model, calibration, self.now.nominal):
            return told
        file = f"{result_folder(row['recording'], row['run'])}/{STROKES_FILE}"
        try:
            table = parsed_strokes(self.now.season.place.read(file), self.now.season.where(file))
        except (DataError, FileNotFoundError):
            return "is damaged: `oarlock season check`"
        name = f"{self._when(row)}, {row['counted']} strokes at {row['rate']:.0f}/min"
        found = StoredPiece(name, table, kind, self.now.when(row)[:10])
        source = found.rowed().source
        own = self.now.rowed.source
        return found if source == own else f"has strokes found in {source}, this piece in {own}"

    def _when(self, row: Mapping[str, Any]) -> str:
        """The day, and the time of it if that is known, for people."""
        when = self.now.when(row)
        return ", ".join(filter(None, (day_text(when[:10]), when[11:])))

    def _opened(self, name: str) -> tuple[Model, Calibration | None] | None:
        try:
            return opened_setup(self.now.season.load_setup(name))[:2]
        except (DataError, ModelError):
            return None

    def _alike(self, row: Mapping[str, Any]) -> bool:
        if self.now.differs(row):
            return False
        own = self.now.rowed
        return bool(
            abs(row["rate"] - own.rate_per_min) <= RATES_ALIKE
            and row["counted"] >= AS_LONG * len(own.numbers)
        )

    def _effort(self, efforts: Efforts, row: Mapping[str, Any]) -> float:
        if is_day(self.now.local(row)):
            return float("nan")
        return efforts.during(row["started"].timestamp(), end_of(row).timestamp())


def _rows(database: Database) -> list[dict[str, Any]]:
    """The recordings of the athlete, the latest first, with counted strokes and their usual rate."""
    rows: list[dict[str, Any]] = database.table(
        "SELECT r.recording, r.run, r.started, r.duration_s, r.status, r.engine, u.setup, s.counted, s.rate "
        "FROM recordings r LEFT JOIN runs u USING (recording, run) LEFT JOIN ("
        "SELECT recording, count(*) AS counted, median(rate) AS rate FROM stroke_values('rate_per_min') "
        "GROUP BY recording) s USING (recording) "
        "WHERE r.kind = 'recording' AND r.started IS NOT NULL ORDER BY r.started DESC, recording"
    ).to_pylist()
    return rows


def _passed(said: Sequence[str], head: str) -> list[str]:
    """What was passed over, in one sentence; the first few of them."""
    if not said:
        return []
    more = f"; and {len(said) - _MOST_NAMED} more" if len(said) > _MOST_NAMED else ""
    return [f"{head}: {'; '.join(said[:_MOST_NAMED])}{more}."]
