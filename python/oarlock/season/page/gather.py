"""`gathered`: everything that the page of a season shows, asked of its database."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from oarlock.season.page.findings import AthleteComparison, beyond_chance, rig_comparison, trend_comparison
from oarlock.season.questions.database import Database
from oarlock.season.store import not_in_season
from oarlock.storage.errors import DataError

USUAL_METRICS = (
    "catch_angle_rad",
    "finish_angle_rad",
    "arc_rad",
    "seat_travel_m",
    "catch_factor_s",
    "rhythm",
)
"""Metrics of a page that asks for no others, as far as the season has them."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class SeasonPageData:
    """What a page shows; SI and radians.

    Args:
        athletes: pseudonyms, in order.
        metrics: columns.
        recordings: one row each: athlete, started, day, week (its Monday), duration_s, status, strokes, comparable.
        classes: classes of runs, most recordings first.
        comparable: the class whose numbers are shown; None without results.
        trends: rows of the question `trend` by athlete and metric.
        compared: all comparisons.
        changes: those that are beyond chance.
        health: rows of `sensor_health`.
        failed: rows of `failed`.
    """

    athletes: Sequence[str]
    metrics: Sequence[str]
    recordings: Sequence[Row]
    classes: Sequence[Row]
    comparable: str | None
    trends: Mapping[tuple[str, str], Sequence[Row]]
    compared: Sequence[AthleteComparison]
    changes: Sequence[AthleteComparison]
    health: Sequence[Row]
    failed: Sequence[Row]


def gathered(
    database: Database, metrics: Sequence[str] | None = None, comparable: str | None = None
) -> SeasonPageData:
    """Ask for everything.

    Args:
        database: of the athletes to show.
        metrics: names; None takes `USUAL_METRICS`.
        comparable: class of runs whose numbers are shown; None takes the one with most recordings.

    Raises:
        DataError: there is no such metric or class, or there is no recording.
    """
    recordings = database.table(
        "SELECT athlete, started, strftime(started, '%Y-%m-%d') AS day, "
        "strftime(date_trunc('week', started), '%Y-%m-%d') AS week, duration_s, status, "
        "coalesce(strokes, 0) AS strokes, comparable FROM recordings ORDER BY athlete, started"
    ).to_pylist()
    if not recordings:
        raise DataError(f"{database.selection}: has no recordings to show; add some: `oarlock season add`")
    classes = database.table("FROM classes").to_pylist()
    shown = _class(classes, comparable)
    columns = _columns(database, metrics) if shown else []
    trends: dict[tuple[str, str], list[Row]] = {}
    compared: list[AthleteComparison] = []
    for column in columns:
        for row in _rows(database, "trend", column, shown):
            trends.setdefault((row["athlete"], column), []).append(row)
        found = [trend_comparison(column, row) for row in _rows(database, "changes", column, shown)]
        found += [rig_comparison(column, row) for row in _rows(database, "rig", column, shown)]
        compared += [one for one in found if one is not None]
    return SeasonPageData(
        athletes=sorted({row["athlete"] for row in recordings}),
        metrics=columns,
        recordings=recordings,
        classes=classes,
        comparable=shown,
        trends=trends,
        compared=compared,
        changes=beyond_chance(compared),
        health=database.table("FROM sensor_health").to_pylist(),
        failed=database.table("FROM failed").to_pylist(),
    )


def _class(classes: Sequence[Row], asked: str | None) -> str | None:
    names = [row["comparable"] for row in classes]
    if asked is not None and asked not in names:
        raise not_in_season("class of runs", asked, names)
    return asked or (names[0] if names else None)


def _columns(database: Database, metrics: Sequence[str] | None) -> list[str]:
    if metrics:
        return list(dict.fromkeys(database.metric(name) for name in metrics))
    return [name for name in USUAL_METRICS if name in database.metrics] or list(database.metrics[:6])


def _rows(database: Database, question: str, column: str, comparable: str | None) -> list[Row]:
    rows: list[Row] = database.table(f"FROM {question}('{column}')").to_pylist()
    return [row for row in rows if row["comparable"] == comparable]
