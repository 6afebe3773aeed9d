"""`earlier_pieces`: last time and own best of an athlete in a season, for the report of a track."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oarlock import Calibration, Model, ModelError, Track
from oarlock.model.description import ImuDescription
from oarlock.recording.session_info import session_info
from oarlock.report import day_text
from oarlock.rowing import find_strokes
from oarlock.rowing.findings.rowed import FEWEST_STROKES, RATES_APART, Rowed, kind_of
from oarlock.rowing.report.stored_piece import StoredPiece
from oarlock.rowing.strokes.files import parsed_strokes
from oarlock.season.add import start_of
from oarlock.season.compute import opened_setup
from oarlock.season.database import Database, Selection
from oarlock.season.records import STROKES_FILE, result_folder
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
    if not season.is_here(pseudonym):
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
        setup = self._setup(row["athlete"], row["setup"])
        if setup is None:
            return "has a setup that cannot be read: `oarlock season check`"
        model, calibration = setup
        if (kind := kind_of(model.joint_names)) != self.now.rowed.kind:
            return f"is {kind}, this piece {self.now.rowed.kind}"
        if told := mounts_differ(model, calibration, self.now.nominal):
            return told
        file = f"{result_folder(row['athlete'], row['recording'], row['run'])}/{STROKES_FILE}"
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

    def _opened(self, athlete: str, name: str) -> tuple[Model, Calibration | None] | None:
        try:
            return opened_setup(self.now.season.load_setup(name, athlete))[:2]
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
        "SELECT r.recording, r.athlete, r.run, r.started, r.duration_s, r.status, r.engine, u.setup, s.counted, s.rate "
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


_NOON = datetime.time(12)


@dataclass(frozen=True)
class Compared:
    """The piece of a report.

    Attributes:
        season: where others are looked for.
        rowed: its strokes.
        start: the moment of its first sample, UTC.
        engine: version of Oarlock that tracked it.
        nominal: its units whose mounts are not calibrated.
    """

    season: Season
    rowed: Rowed
    start: datetime.datetime
    engine: str
    nominal: frozenset[str]

    @classmethod
    def of(cls, season: Season, track: Track, start: datetime.datetime) -> Compared:
        """Of a track of a rower.

        Raises:
            DataError: there are no strokes in it.
        """
        found = find_strokes(track)
        kind = kind_of(track.joint_names)
        rowed = Rowed.of_table(found.table(), found.in_averages, kind, found.source)
        about = track.provenance
        return cls(
            season, rowed, start, str(about.get("oarlock", "")), frozenset(about.get("nominal_mounts", ()))
        )

    def follows(self, row: Mapping[str, Any]) -> bool:
        """Whether a recording ended before this one; where only days are known, on a day before."""
        days = [self.local(row), self.start.astimezone(self.season.zone())]
        if any(map(is_day, days)):
            return days[0].date() < days[1].date()
        return bool(end_of(row) <= self.start)

    def local(self, row: Mapping[str, Any]) -> datetime.datetime:
        """The start of a recording in the season's zone."""
        moment: datetime.datetime = row["started"]
        return moment.astimezone(self.season.zone())

    def when(self, row: Mapping[str, Any]) -> str:
        """Day and time of a recording; only the day where the time is not known."""
        local = self.local(row)
        return f"{local:%Y-%m-%d}" if is_day(local) else f"{local:%Y-%m-%d %H:%M}"

    def differs(self, row: Mapping[str, Any]) -> str:
        """Why a recording does not compare, as far as the tables say; "" if it may."""
        if row["status"] != "done":
            return (
                "could not be computed"
                if row["status"] == "failed"
                else "is not computed yet: `oarlock season run`"
            )
        if not row["counted"] or row["counted"] < FEWEST_STROKES:
            return f"has {row['counted'] or 0} strokes that count, at least {FEWEST_STROKES} are needed"
        if row["rate"] is None or not abs(row["rate"] - self.rowed.rate_per_min) <= RATES_APART:
            rate = "an unknown rate" if row["rate"] is None else f"{row['rate']:.0f}/min"
            return f"has {rate}, this piece {self.rowed.rate_per_min:.0f}/min"
        if row["engine"] != self.engine:
            return (
                f"was computed by Oarlock {row['engine']}, this piece by {self.engine}: `oarlock season run`"
            )
        return ""


def end_of(row: Mapping[str, Any]) -> datetime.datetime:
    """When a recording ended; without a duration its start."""
    started: datetime.datetime = row["started"]
    return started + datetime.timedelta(seconds=row["duration_s"] or 0.0)


def is_day(local: datetime.datetime) -> bool:
    """Whether only the day of a recording is known; then `start_of` takes its noon."""
    return local.time() == _NOON


def mounts_differ(model: Model, calibration: Calibration | None, nominal: frozenset[str]) -> str:
    """Why mounts differ: errors of nominal ones, several degrees, would look like a change; "" if they are alike."""
    if calibration is None:
        units = any(isinstance(sensor, ImuDescription) for sensor in model.describe().sensors)
        return "is not calibrated, this piece is" if units and not nominal else ""
    return (
        "is calibrated, this piece is not: `oarlock calibrate`" if nominal & set(calibration.mounts) else ""
    )


Floats = NDArray[np.float64]

MEASURES = {"sculling": "speed_m_s", "sweep": "speed_m_s", "ergometer": "power_w"}
"""The number that says how fast a piece was, by kind of rowing."""
COVERED = 0.8
"""Smallest share of a piece from the export's first to its last stroke in it."""
_TIMES = ("end_time_s", "finish_time_s", "time_s")
_RATES_PER_MIN = (14.0, 50.0)
"""Strokes outside are paddling or misread, as in `rowing.alongside.stretches`."""
_FEWEST = 6


@dataclass(frozen=True, eq=False)
class Efforts:
    """Strokes of the devices that measured an athlete's pace.

    Attributes:
        measure: column of the numbers.
        exports: of each export the end of each stroke, s since 1970, and its number, (N,) each.
    """

    measure: str
    exports: tuple[tuple[Floats, Floats], ...]

    @classmethod
    def of(cls, database: Database, kind: str) -> Efforts:
        """Those of the one athlete whom the database was opened for.

        An export whose clock restarts is left out: when its strokes were rowed is not known.
        """
        measure = MEASURES[kind]
        columns = set(database.table("DESCRIBE strokes")["column_name"].to_pylist())
        times = [name for name in _TIMES if name in columns]
        if not times or not {measure, "rate_per_min"} <= columns:
            return cls(measure, ())
        low, high = _RATES_PER_MIN
        rows = database.table(
            f"SELECT s.recording, epoch(s.started) + coalesce({', '.join(times)}) AS at_s, {measure}::DOUBLE AS value "
            "FROM strokes s JOIN recordings r USING (recording) "
            f"WHERE r.kind = 'export' AND s.started IS NOT NULL AND {measure} > 0 "
            f"AND rate_per_min BETWEEN {low} AND {high} ORDER BY s.recording, stroke"
        )
        return cls(measure, tuple(_exports(rows.to_pydict())))

    def during(self, start_s: float, end_s: float) -> float:
        """Mean over a piece, of the export that covers most of it; NaN without one. Moments in s since 1970."""
        best, covered = float("nan"), COVERED * (end_s - start_s)
        for at_s, value in self.exports:
            inside = (at_s >= start_s) & (at_s <= end_s)
            if inside.sum() >= _FEWEST and (length := float(np.ptp(at_s[inside]))) >= covered:
                best, covered = float(np.mean(value[inside])), length
        return best


def _exports(rows: dict[str, list[object]]) -> Iterator[tuple[Floats, Floats]]:
    at_s, value = (np.array(rows[name], dtype=np.float64) for name in ("at_s", "value"))
    names = np.array(rows["recording"], dtype=str)
    for name in np.unique(names):
        own = (names == name) & np.isfinite(at_s)
        if (np.diff(at_s[own]) > 0.0).all():
            yield at_s[own], value[own]
