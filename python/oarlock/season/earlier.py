"""`earlier_pieces`: last time and own best of an athlete in a season, for the report of a track."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

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
_EFFORTS = {"sculling": "speed_m_s", "sweep": "speed_m_s", "ergometer": "power_w"}
"""The number that says how fast a piece was, by kind of rowing."""
_TIMES = ("end_time_s", "finish_time_s", "time_s")
_MOST_NAMED = 3
_NOON = datetime.time(12)

Row = Mapping[str, Any]


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
    try:
        search = _Search(season, track, names or {})
    except _NotComparedError as error:
        return EarlierPieces(notes=(f'Not compared with the season "{season.name}": {error}',))
    with Database(season, Selection(athlete=search.athlete)) as database:
        search.rows = [row for row in _rows(database) if search.follows(row)]
        efforts = _efforts(database, _EFFORTS[search.rowed.kind]) if best and search.rows else {}
    if not search.rows:
        return EarlierPieces(
            notes=(f'Not compared: the season "{season.name}" has no earlier piece of this athlete.',)
        )
    latest, notes = search.last() if last else (None, [])
    record, more = search.best(efforts, latest) if best else (None, [])
    return EarlierPieces(latest, record, (*notes, *more))


class _NotComparedError(Exception):
    """Why there is nothing to look for."""


class _Search:
    """The piece of a report, and the earlier recordings of its athlete, the latest first."""

    def __init__(self, season: Season, track: Track, names: Mapping[str, str]) -> None:
        self.season, self.rows = season, list[Row]()
        about, info = track.provenance, session_info(track.provenance)
        if not (person := info.get("athlete", "")):
            raise _NotComparedError(
                'the track does not say whose it is. Write athlete = "..." into its session.toml.'
            )
        self.athlete = names.get(person, person)
        if not season.is_here(self.athlete):
            hint = (
                "" if names else " If it knows the athlete by a pseudonym, give the file of names (--names)."
            )
            raise _NotComparedError(f"it contains nothing of {person}.{hint}")
        start = start_of(season, about.get("epoch"), float(track.time_s[0]), info)
        if start is None:
            raise _NotComparedError(
                'the date of this piece is not known. Write date = "2026-05-01" into its session.toml.'
            )
        try:
            strokes = find_strokes(track)
            kind = kind_of(track.joint_names)
            self.rowed = Rowed.of_table(strokes.table(), strokes.in_averages, kind, strokes.source)
        except DataError as error:
            raise _NotComparedError(f"no strokes were found in this piece: {error}") from error
        if not len(self.rowed.numbers):
            raise _NotComparedError("no stroke of this piece counts in averages.")
        self.start, self.engine = start, str(about.get("oarlock", ""))
        self.nominal = frozenset(about.get("nominal_mounts", ()))
        self._setup, self._piece = cache(self._opened), dict[str, StoredPiece | str]()

    def follows(self, row: Row) -> bool:
        """Whether a recording ended before this one; where only days are known, on a day before."""
        then, now = self._local(row), self.start.astimezone(self.season.zone())
        if _NOON in (then.time(), now.time()):
            return then.date() < now.date()
        return bool(row["started"] + datetime.timedelta(seconds=row["duration_s"] or 0.0) <= self.start)

    def last(self) -> tuple[StoredPiece | None, list[str]]:
        """The latest that compares, and notes."""
        reasons: list[str] = []
        for row in self.rows:
            piece = self.piece(row)
            if isinstance(piece, StoredPiece):
                rule = "the latest earlier piece of the same kind, signal and about the same rate"
                note = f"Last time: {piece.name}; {rule} in the season."
                return piece, [note, *_listed(reasons, "Later, but not compared")]
            reasons.append(f"{self._when(row)} {piece}")
        note = "Last time: no earlier piece in the season compares."
        return None, [note, *_listed(reasons, "Not compared")]

    def best(
        self, efforts: Mapping[str, float], last: StoredPiece | None
    ) -> tuple[StoredPiece | None, list[str]]:
        """The fastest at this rate, and notes; None if it is last time's."""
        is_speed = _EFFORTS[self.rowed.kind] == "speed_m_s"
        what, digits, unit = ("boat speed", 2, "m/s") if is_speed else ("power", 0, "W")
        rule = (
            f"the highest mean {what} at this rate (within {RATES_ALIKE:.0f}/min) "
            f"and at least {100.0 * AS_LONG:.0f} % as many strokes"
        )
        known = [row for row in self.rows if row["recording"] in efforts and self._is_alike(row)]
        for row in sorted(known, key=lambda row: -efforts[row["recording"]]):
            piece = self.piece(row)
            if isinstance(piece, StoredPiece):
                same = " It is last time's piece." if piece is last else ""
                wind = " Wind and stream are not removed." if is_speed else ""
                value = f"{efforts[row['recording']]:.{digits}f} {unit}"
                note = f"Own best: {piece.name}, {value}; {rule} among earlier pieces.{wind}{same}"
                return (None if same else piece), [note]
        return None, [
            f"Own best: none is claimed. It would be {rule}; the season has no such earlier piece with "
            "a device's export of the same time (`oarlock season add`)."
        ]

    def piece(self, row: Row) -> StoredPiece | str:
        """The piece, or why it does not compare."""
        name = row["recording"]
        if name not in self._piece:
            self._piece[name] = self._differs(row) or self._read(row)
        return self._piece[name]

    def _is_alike(self, row: Row) -> bool:
        return (
            not self._differs(row)
            and self._local(row).time() != _NOON
            and abs(row["rate"] - self.rowed.rate_per_min) <= RATES_ALIKE
            and row["counted"] >= AS_LONG * len(self.rowed.numbers)
        )

    def _differs(self, row: Row) -> str:
        """Why a recording does not compare, as far as the tables say; "" if it may."""
        if row["status"] != "done":
            is_failed = row["status"] == "failed"
            return "could not be computed" if is_failed else "is not computed yet: `oarlock season run`"
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

    def _read(self, row: Row) -> StoredPiece | str:
        setup = self._setup(row["setup"])
        if setup is None:
            return "has a setup that cannot be read: `oarlock season check`"
        if (kind := kind_of(setup[0].joint_names)) != self.rowed.kind:
            return f"is {kind}, this piece {self.rowed.kind}"
        if difference := self._mounts_differ(*setup):
            return difference
        file = f"{result_folder(self.athlete, row['recording'], row['run'])}/{STROKES_FILE}"
        try:
            table = parsed_strokes(self.season.place.read(file), self.season.where(file))
        except (DataError, FileNotFoundError):
            return "is damaged: `oarlock season check`"
        name = f"{self._when(row)}, {row['counted']} strokes at {row['rate']:.0f}/min"
        piece = StoredPiece(name, table, kind, f"{self._local(row):%Y-%m-%d}")
        source, own = piece.rowed().source, self.rowed.source
        return piece if source == own else f"has strokes found in {source}, this piece in {own}"

    def _mounts_differ(self, model: Model, calibration: Calibration | None) -> str:
        """Why mounts differ; "" if they do not. Errors of nominal ones, several degrees, would look like a change."""
        if calibration is None:
            units = any(isinstance(sensor, ImuDescription) for sensor in model.describe().sensors)
            return "is not calibrated, this piece is" if units and not self.nominal else ""
        is_nominal = self.nominal & set(calibration.mounts)
        return "is calibrated, this piece is not: `oarlock calibrate`" if is_nominal else ""

    def _opened(self, setup: str) -> tuple[Model, Calibration | None] | None:
        try:
            return opened_setup(self.season.load_setup(setup, self.athlete))[:2]
        except (DataError, ModelError):
            return None

    def _local(self, row: Row) -> datetime.datetime:
        """The start of a recording in the season's zone; noon where only the day is known (`start_of`)."""
        moment: datetime.datetime = row["started"]
        return moment.astimezone(self.season.zone())

    def _when(self, row: Row) -> str:
        """The day, and the time of it if that is known, for people."""
        local = self._local(row)
        day = day_text(f"{local:%Y-%m-%d}")
        return day if local.time() == _NOON else f"{day}, {local:%H:%M}"


def _rows(database: Database) -> list[dict[str, Any]]:
    """The recordings of the athlete, the latest first, with counted strokes and their usual rate."""
    return database.rows(
        "SELECT r.recording, r.run, r.started, r.duration_s, r.status, r.engine, u.setup, s.counted, s.rate "
        "FROM recordings r LEFT JOIN runs u USING (recording, run) LEFT JOIN ("
        "SELECT recording, count(*) AS counted, median(rate) AS rate FROM stroke_values('rate_per_min') "
        "GROUP BY recording) s USING (recording) "
        "WHERE r.kind = 'recording' AND r.started IS NOT NULL ORDER BY r.started DESC, recording"
    )


def _efforts(database: Database, measure: str) -> dict[str, float]:
    """Mean boat speed or power of each recording, of the export that covers most of it, at least 80 %, with 6 strokes.

    An export whose clock restarts is left out: when its strokes were rowed is not known.
    """
    times = [name for name in _TIMES if name in database.metrics]
    if not times or measure not in database.metrics:
        return {}
    rows = database.rows(f"""
        WITH e AS (
            SELECT recording AS export, epoch(s.started) + coalesce({", ".join(times)}) AS at_s, v.value,
                at_s - lag(at_s) OVER (PARTITION BY recording ORDER BY stroke) AS step_s
            FROM stroke_values('{measure}') v JOIN strokes s USING (recording, stroke)
                JOIN recordings r USING (recording)
            WHERE r.kind = 'export' AND at_s IS NOT NULL AND v.value > 0
        ),
        p AS (
            SELECT recording, export, avg(value) AS value, max(at_s) - min(at_s) AS covered_s
            FROM recordings r JOIN e ON at_s BETWEEN epoch(started) AND epoch(started) + duration_s
            WHERE kind = 'recording'
                AND export IN (SELECT export FROM e GROUP BY export HAVING coalesce(min(step_s), 1) > 0)
            GROUP BY recording, export, duration_s HAVING count(*) >= 6 AND covered_s >= 0.8 * duration_s
        )
        SELECT recording, arg_max(value, covered_s)::DOUBLE AS value FROM p GROUP BY recording""")
    return {row["recording"]: row["value"] for row in rows}


def _listed(reasons: Sequence[str], head: str) -> list[str]:
    """The first few reasons in one sentence."""
    if not reasons:
        return []
    more = f"; and {len(reasons) - _MOST_NAMED} more" if len(reasons) > _MOST_NAMED else ""
    return [f"{head}: {'; '.join(reasons[:_MOST_NAMED])}{more}."]
