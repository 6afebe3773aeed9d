"""`ask`, `trend` and `left_out`: the ready questions to a season from Python, and how their metrics are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

from oarlock.report.text import listing, plural
from oarlock.season.database import SIDED, Database, Selection, rate_range
from oarlock.season.store import Season
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    import pyarrow as pa

MONTHS_FOR_CHANGE = 4


@dataclass(frozen=True)
class Question:
    """A ready question.

    Args:
        name: of the macro or view.
        of_metric: whether it is asked of one metric, and of a range of stroke rates.
        compares: whether it brings numbers of several recordings together, so that they must be comparable.
        is_macro: whether it is called with parentheses.
    """

    name: str
    line: str
    of_metric: bool = True
    compares: bool = True
    is_macro: bool = True

    def sql(self, metric: str | None = None, low: float | None = None, high: float | None = None) -> str:
        """The statement that asks it; the metric is the name of a column."""
        if not self.is_macro:
            return f"FROM {self.name}"
        if not self.of_metric:
            return f"FROM {self.name}()"
        assert metric is not None
        limits = {"rate_from": low, "rate_to": high}
        rates = "".join(f", {name} := {value!r}" for name, value in limits.items() if value is not None)
        return f"FROM {self.name}('{metric}'{rates})"


QUESTIONS = (
    Question("trend", "Mean of each month, with its band; one row an athlete and month."),
    Question("changes", "Change a month over the time asked for, with its band; one row an athlete."),
    Question("drift", "Last third of a session against its first, at equal rate; one row an athlete."),
    Question("consistency", "Standard deviation within a piece against the rate, in classes of 2/min."),
    Question("same_rate", "Athletes compared at the same rate, in classes of 2/min."),
    Question("sides", "Right against left; one row an athlete."),
    Question("rig", "After a change of rig against before, 60 days each; one row an athlete and change."),
    Question("crew", "Catch relative to the stroke seat; one row a seat and month.", of_metric=False),
    Question("sensor_health", "Numbers about the sensors by athlete and month.", False, False, False),
    Question("failed", "Recordings without a result, and why.", False, False, False),
    Question("classes", "Classes of runs: numbers are compared only within one.", False, False, False),
    Question("sessions", "Mean, standard error and scatter; one row a recording."),
    Question("session_drifts", "Last third against first; one row a recording."),
    Question("outings", "Catch relative to the stroke seat; one row a recording.", of_metric=False),
)
"""All ready questions that a season answers, with one line each."""
_BASES = {
    **dict.fromkeys(("drift", "session_drifts"), "session_drifts"),
    **dict.fromkeys(("consistency", "same_rate"), "pieces"),
    **dict.fromkeys(("crew", "outings"), "outings"),
}
"""The macro with a row for each recording that is part of the answer to a question; of others `sessions`."""
_NEEDS = {
    "sessions": "10 strokes that count",
    "session_drifts": "10 strokes that count in the first and in the last third",
    "pieces": "10 strokes that count at one rate",
    "outings": "10 strokes that count beside a recording of the same boat, of a seat nearer to the stern",
}
_LACKS = {
    "changes": ("started IS NULL", "no date"),
    "rig": ("(started IS NULL OR boat IS NULL OR rig IS NULL)", "no date, no boat or no rig"),
}
"""What else a session may lack that a question needs: condition and words."""

_SCALED = (
    *("mean", "low", "high", "per_month", "change", "sd"),
    *("noise", "first", "last", "drift", "difference", "se"),
)
"""Columns of the ready questions that are in the unit of the metric."""


@dataclass(frozen=True)
class ShownMetric:
    """How a metric is shown: a label, a unit such as "deg", and the factor from the column's unit to it."""

    label: str
    unit: str
    scale: float


def shown_metric(column: str) -> ShownMetric:
    """How a column is shown; one that Oarlock does not define is shown as it is."""
    from oarlock.rowing import FEATURES

    if (feature := FEATURES.get(column)) is None:
        return ShownMetric(column, "", 1.0)
    unit = "" if feature.shown_unit == "1" else feature.shown_unit
    return ShownMetric(feature.label, unit, feature.shown_scale)


def is_scaled(column: str) -> bool:
    """Whether a column of a ready question is in the unit of the metric."""
    return column.removesuffix("_before").removesuffix("_after") in _SCALED


@dataclass(frozen=True)
class Change:
    """How a metric changed over months, in its own unit.

    Args:
        per_month: change a month of 30.4 days.
        low: lower end of its 95 % band.
        change: from the first month to the last.
        changed: whether the 99.9 % band is beside zero. Of 1,000 athletes without a change about one is said to have
            changed.
    """

    per_month: float
    low: float
    high: float
    change: float
    changed: bool


@dataclass(frozen=True)
class Trend:
    """A metric of one athlete over the months.

    Args:
        metric: the column; `oarlock.rowing.FEATURES` explains it.
        comparable: class of all runs that were used.
        months: one row a month: `month`, `sessions`, `strokes`, `rate`, `mean`, `low` and `high` (95 % band), `se`.
        change: None with fewer than 4 months.
        notes: sentences on what is left out, and on what else differs between the recordings.
    """

    athlete: str
    metric: str
    comparable: str
    months: pa.Table
    change: Change | None
    notes: Sequence[str]


def ask(
    season: Season,
    question: str,
    metric: str | None = None,
    rates: str | None = None,
    selection: Selection | None = None,
) -> pa.Table:
    """Ask a ready question.

    Args:
        season: which.
        question: name of one of `QUESTIONS`.
        metric: its name, with or without its unit: `catch_angle`.
        rates: stroke rates, 1/min, such as "20-24"; None takes all.
        selection: of whom, of which days and of which class of runs.

    Returns:
        The rows; SI and radians. `left_out` says which sessions have none, and why.

    Raises:
        DataError: there is no such question, metric, athlete or class, or the runs are of several classes.
    """
    with Database(season, selection) as database:
        return answer(database, question, metric, rates)


def answer(
    database: Database, question: str, metric: str | None = None, rates: str | None = None
) -> pa.Table:
    """As `ask`, of a database that is open."""
    asked = question_named(question)
    if asked.of_metric and metric is None:
        raise DataError(f"the question {asked.name} needs a metric, such as catch_angle")
    column = database.metric(metric) if asked.of_metric and metric is not None else None
    low, high = rate_range(rates)
    if asked.compares:
        one_class(database)
    return database.table(asked.sql(column, low, high))


def left_out(
    database: Database, question: str, metric: str | None = None, rates: str | None = None
) -> list[str]:
    """Sentences on strokes, sessions and athletes that are not part of the answer to a ready question, and why."""
    asked = question_named(question)
    if not asked.compares:
        return []
    macro = _BASES.get(asked.name, "sessions")
    column = database.metric(metric) if asked.of_metric and metric is not None else "catch_time_s"
    values = column + SIDED if asked.name == "sides" else column
    low, high = rate_range(rates)
    base = replace(asked, name=macro).sql(values, low, high)
    counted = Question("stroke_values", "").sql(values, low, high)
    lack, words = _LACKS.get(asked.name, ("false", ""))
    (total,) = database.rows(
        "SELECT count(*) AS n, sum(strokes) AS strokes, sum(left_out) AS k FROM recordings"
    )
    lines = []
    if total["k"]:
        beside = f"{total['k']:,} of {total['strokes']:,} strokes"
        lines.append(f"{beside} do not count: misread ones, paddling, starts (`in_averages`).")
    rows = database.rows(f"""
        SELECT coalesce(file, device, recording[:8]) AS source, started, strokes, n, CASE
            WHEN status = 'failed' THEN 'failed; `oarlock season questions SEASON failed` says why'
            WHEN status = 'waiting' THEN 'no result yet; `oarlock season run` computes it'
            WHEN strokes = 0 THEN 'no strokes'
            WHEN coalesce(n, 0) = 0 THEN 'no stroke that counts has this number'
            WHEN recording NOT IN (SELECT recording {base}) THEN 'fewer than {_NEEDS[macro]}'
            ELSE '{words}' END AS why
        FROM recordings LEFT JOIN (SELECT recording, count(value) AS n {counted} GROUP BY recording)
            USING (recording)
        WHERE recording NOT IN (SELECT recording {base}) OR {lack} ORDER BY why, started, recording""")
    for why, group in groupby(rows, key=lambda row: row["why"]):
        names = [_named(row) for row in group]
        lines.append(f"{len(names)} of {plural(total['n'], 'session')} left out, {why}: {listing(names)}.")
    if asked.name == "changes":
        changes = database.rows(asked.sql(column, low, high))
        few = [row["athlete"] for row in changes if row["months"] < MONTHS_FOR_CHANGE]
        why = f"not known, because it needs results in {MONTHS_FOR_CHANGE} months"
        lines += [f"Change {why}: {listing(few)}."] if few else []
    if asked.name == "rig":
        lines.append("A change of rig needs two sessions in the 60 days before it, and two after it.")
    return lines


def _named(row: Mapping[str, Any]) -> str:
    day = f" of {row['started']:%Y-%m-%d}" if row["started"] else ""
    return f"{row['source']}{day}" + (f" ({row['n']} of {row['strokes']} strokes)" if row["n"] else "")


def trend(
    season: Season, athlete: str, metric: str, rates: str | None = None, selection: Selection | None = None
) -> Trend:
    """How a metric of one athlete went over the months.

    Strokes are weighted by their uncertainty, sessions by theirs and by how much sessions differ. All are brought to
    the athlete's usual stroke rate.

    Args:
        season: which.
        athlete: the pseudonym.
        metric: its name, with or without its unit: `catch_angle`.
        rates: stroke rates, 1/min, such as "20-24"; None takes all.
        selection: of which days, boat and class of runs.

    Raises:
        DataError: there is no such athlete or metric, no stroke of it, or the runs are of several classes.
    """
    with Database(season, replace(selection or Selection(), athlete=athlete)) as database:
        column = database.metric(metric)
        comparable = one_class(database)
        months = answer(database, "trend", column, rates)
        beside = left_out(database, "trend", column, rates)
        if not months.num_rows:
            words = f"has no session with 10 strokes of {column} or more that count"
            raise DataError(" ".join([f"{database.selection}: {words}.", *beside]))
        (row,) = answer(database, "changes", column, rates).to_pylist()[:1] or [{"low": None}]
        change = None
        if row["low"] is not None:
            change = Change(**{key: row[key] for key in ("per_month", "low", "high", "change", "changed")})
        notes = [*_notes(database, months.num_rows), *_rate_notes(column, months), *beside]
        return Trend(athlete, column, comparable, months, change, notes)


def question_named(name: str) -> Question:
    """A ready question."""
    for question in QUESTIONS:
        if question.name == name.replace("-", "_"):
            return question
    known = (question.name for question in QUESTIONS)
    raise DataError(f'"{name}" is no ready question. {did_you_mean(name, known)}')


def one_class(database: Database) -> str:
    """The class of all runs asked."""
    classes = database.classes()
    if not classes:
        raise DataError(f"{database.selection}: has no results; compute them: `oarlock season run`")
    first = next(iter(classes))
    if len(classes) > 1:
        each = "; ".join(
            f"{name} (oarlock {engine}, {count} recordings)" for name, (engine, count) in classes.items()
        )
        raise DataError(
            f"{database.selection}: the results are of {len(classes)} classes (engine, model, settings or "
            f"calibration differ) and cannot be compared: {each}. Choose one with --class {first}, or "
            f"compute all of them in the same way: `oarlock season run {database.season.place.address}`."
        )
    return first


def _rate_notes(metric: str, months: pa.Table) -> list[str]:
    """To which rate the means of months are brought."""
    rows = [row for row in months.to_pylist() if row["rate"] is not None]
    strokes = sum(row["strokes"] for row in rows)
    if metric == "rate_per_min" or not strokes:
        return []
    usual = sum(row["strokes"] * row["rate"] for row in rows) / strokes
    return [
        f"Means are brought to the usual rate of about {usual:.0f} strokes a minute, with the slope inside of "
        "sessions; the question `sessions` has them as they were."
    ]


def _notes(database: Database, months: int) -> list[str]:
    notes = []
    if months < MONTHS_FOR_CHANGE:
        notes.append(f"A change is stated from {MONTHS_FOR_CHANGE} months on; here are {months}.")
    done = "FROM recordings WHERE status = 'done'"
    boats = database.rows(f"SELECT DISTINCT boat {done} AND boat IS NOT NULL ORDER BY boat")
    if len(boats) > 1:
        names = ", ".join(row["boat"] for row in boats)
        notes.append(f"Rowed in several boats: {names}. Choose one with --boat.")
    devices = database.rows(f"SELECT DISTINCT device {done} AND device IS NOT NULL ORDER BY device")
    if len(devices) > 1:
        names = ", ".join(row["device"] for row in devices)
        notes.append(
            f"Measured by several kinds of device, whose numbers may mean different things: {names}."
        )
    rigs = database.rows(
        f"SELECT boat, rig, strftime(min(started), '%Y-%m-%d') AS day {done} AND rig IS NOT NULL "
        "GROUP BY boat, rig QUALIFY row_number() OVER (PARTITION BY boat ORDER BY min(started)) > 1 ORDER BY day"
    )
    return notes + [
        f"The rig of {row['boat'] or 'the boat'} changed to {row['rig']} on {row['day']}, which may explain a "
        "change. The question `rig` compares before and after."
        for row in rigs
    ]
