"""`oarlock season query`, `trend` and `questions`: what a season answers."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Json, Replace, example
from oarlock.cli.season_options import SeasonAt, opened
from oarlock.cli.season_tables import show_answer, show_rows, shown_band, shown_value, write_table
from oarlock.cli.terminal import UsageError, free_file, pairs, print_json, say, steps, table, verb

if TYPE_CHECKING:
    import pyarrow as pa

    from oarlock.season import Selection, Trend

_MetricName = Annotated[
    str | None, typer.Option("--metric", metavar="NAME", help="Number of a stroke, such as catch_angle.")
]
_Rate = Annotated[
    str | None,
    typer.Option("--rate-spm", metavar="LOW-HIGH", help="Only strokes at these rates, such as 20-24."),
]
_AthleteName = Annotated[
    str | None, typer.Option("--athlete", metavar="PSEUDONYM", help="Only this athlete.")
]
_Boat = Annotated[str | None, typer.Option("--boat", metavar="TEXT", help="Only in this boat.")]
_Class = Annotated[
    str | None, typer.Option("--class", metavar="NAME", help="Only this class of comparable runs.")
]
_Since = Annotated[str | None, typer.Option("--since", metavar="DATE", help="First day, such as 2026-03-01.")]
_Until = Annotated[str | None, typer.Option("--until", metavar="DATE", help="Last day.")]
_Scope = Annotated[
    str | None,
    typer.Option(
        "--scope", metavar="NAME", help="Only athletes who consent to: coaching, research, sharing."
    ),
]
_Csv = Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write all rows as CSV.")]
_Parquet = Annotated[
    Path | None, typer.Option("--parquet", metavar="FILE", help="Write all rows as Parquet.")
]


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    group.command(
        "questions",
        epilog=example(
            "oarlock season questions season",
            "oarlock season questions season drift --metric catch_angle --rate-spm 20-24",
            "oarlock season questions season crew --boat '2x Heron' --csv crew.csv",
        ),
    )(questions)
    group.command(
        "trend",
        epilog=example(
            "oarlock season trend season --athlete K7QMVA --metric catch_angle --rate-spm 20-24",
            "oarlock season trend season --metric catch_factor --since 2026-03-01",
        ),
    )(trend)
    group.command(
        "query",
        epilog=example(
            'oarlock season query season "SELECT athlete, count(*) FROM recordings GROUP BY athlete"',
            "oarlock season query season \"FROM trend('catch_angle_rad', rate_from := 20)\" --csv trend.csv",
            'oarlock season query season "DESCRIBE strokes"',
        ),
    )(query)


@verb
def questions(
    at: SeasonAt,
    question: Annotated[
        str | None, typer.Argument(metavar="QUESTION", help="The one to ask; default: list all.")
    ] = None,
    metric: _MetricName = None,
    rate: _Rate = None,
    athlete: _AthleteName = None,
    boat: _Boat = None,
    comparable: _Class = None,
    since: _Since = None,
    until: _Until = None,
    scope: _Scope = None,
    csv: _Csv = None,
    parquet: _Parquet = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """List the ready questions, or ask one.

    Means have 95 % bands. Results of different engines, models or calibrations are never compared.
    """
    from oarlock.season import QUESTIONS, Database
    from oarlock.season.questions import answer, question_named

    if question is None:
        if json_output:
            return print_json({one.name: one.line for one in QUESTIONS})
        table(("question", "answers"), [(one.name, one.line) for one in QUESTIONS])
        return steps(
            f"oarlock season questions {at} drift --metric catch_angle",
            f"oarlock season query {at} \"FROM drift('catch_angle_rad')\"",
        )
    asked = question_named(question)
    if asked.of_metric and metric is None:
        raise UsageError(f"the question {asked.name} needs a metric, such as --metric catch_angle")
    for file in (csv, parquet):
        if file is not None:
            free_file(file, force)
    with Database(opened(at), _selection(athlete, boat, comparable, since, until, scope)) as database:
        column = database.metric(metric) if asked.of_metric and metric is not None else None
        rows = answer(database, asked.name, column, rate)
    if not _written(rows, csv, parquet, json_output):
        show_answer(rows, column)


@verb
def trend(
    at: SeasonAt,
    metric: Annotated[
        str, typer.Option("--metric", metavar="NAME", help="Number of a stroke, such as catch_angle.")
    ],
    athlete: _AthleteName = None,
    rate: _Rate = None,
    boat: _Boat = None,
    comparable: _Class = None,
    since: _Since = None,
    until: _Until = None,
    scope: _Scope = None,
    json_output: Json = False,
) -> None:
    """Show a metric month by month, with 95 % bands; without --athlete, the change of each athlete.

    Strokes are weighted by their uncertainty. Means are corrected to the athlete's usual stroke rate.
    """
    from oarlock.season import trend as trend_of

    if athlete is None:
        return questions(
            at, "changes", metric, rate, None, boat, comparable, since, until, scope, json_output=json_output
        )
    selection = _selection(athlete, boat, comparable, since, until, scope)
    found = trend_of(opened(at), athlete, metric, rate, selection)
    if json_output:
        return print_json({**vars(found), "months": found.months.to_pylist()})
    _say_trend(found)


def _say_trend(found: Trend) -> None:
    from oarlock.season.questions import shown_metric

    metric = shown_metric(found.metric)
    label = f"{metric.label}, {metric.unit}" if metric.unit else metric.label
    say(f"{label}: {found.athlete}", style="bold")
    table(
        ("month", ">sessions", ">strokes", ">rate", f">mean {metric.unit}".rstrip(), "95 % band"),
        [
            (
                row["month"],
                row["sessions"],
                row["strokes"],
                shown_value(row["rate"], 1.0),
                shown_value(row["mean"], metric.scale),
                shown_band(row["low"], row["high"], metric.scale),
            )
            for row in found.months.to_pylist()
        ],
    )
    if (change := found.change) is not None:
        band = shown_band(change.low, change.high, metric.scale)
        words = "changed" if change.changed else "no certain change"
        pairs(
            [
                ("change a month", f"{shown_value(change.per_month, metric.scale)} {metric.unit} ({band})"),
                ("first to last month", f"{shown_value(change.change, metric.scale)} {metric.unit}: {words}"),
            ]
        )
    for note in found.notes:
        say(f"- {note}")


@verb
def query(
    at: SeasonAt,
    sql: Annotated[str, typer.Argument(metavar="SQL", help="One statement that reads.")],
    scope: _Scope = None,
    csv: _Csv = None,
    parquet: _Parquet = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Ask in SQL: tables strokes, recordings, runs and athletes, and all ready questions.

    Nothing can be changed, and no other file can be read. Numbers are SI and radians.
    """
    from oarlock.season import Database, Selection

    for file in (csv, parquet):
        if file is not None:
            free_file(file, force)
    with Database(opened(at), Selection(scope=scope)) as database:
        rows = database.table(sql)
    if not _written(rows, csv, parquet, json_output):
        show_rows(rows)


def _written(rows: pa.Table, csv: Path | None, parquet: Path | None, json_output: bool) -> bool:
    """Whether the rows went to files or were printed as JSON."""
    for file in (csv, parquet):
        if file is not None:
            write_table(rows, file, "csv" if file is csv else "parquet")
    if json_output:
        print_json(rows.to_pylist())
        return True
    if csv is None and parquet is None:
        return False
    say(f"Wrote {rows.num_rows} rows to {' and '.join(str(file) for file in (csv, parquet) if file)}")
    return True


def _selection(
    athlete: str | None,
    boat: str | None,
    comparable: str | None,
    since: str | None,
    until: str | None,
    scope: str | None,
) -> Selection:
    from oarlock.season import Selection

    return Selection(athlete, boat, comparable, _day(since, "--since"), _day(until, "--until"), scope)


def _day(text: str | None, flag: str) -> datetime.date | None:
    try:
        return None if text is None else datetime.date.fromisoformat(text)
    except ValueError:
        raise UsageError(f'{flag}: "{text}" is no day; expected one such as 2026-03-01') from None
