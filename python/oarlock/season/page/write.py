"""`write_season_page`: the page of a season as one HTML file."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from oarlock.report.markup import notes_list
from oarlock.report.page import shell
from oarlock.report.section import KeyFigure, tiles
from oarlock.report.sortable import sort_script
from oarlock.report.text import plural
from oarlock.season.page.gather import SeasonPageData, gathered
from oarlock.season.page.heat import duration, heat_map
from oarlock.season.page.sections import changes_section, failed_section, health_section, trends_section
from oarlock.season.questions.database import Database
from oarlock.season.questions.selection import Selection
from oarlock.season.questions.shown import shown_metric
from oarlock.season.store import Season
from oarlock.storage.write_file import write_file


def write_season_page(
    season: Season,
    path: str | Path,
    metrics: Sequence[str] | None = None,
    selection: Selection | None = None,
    comparable: str | None = None,
) -> Path:
    """Write a page that works offline: sessions, changes, trends, sensors and failed recordings.

    Args:
        season: which.
        path: the file to write, or an existing folder, which gets ``season.html``. Missing parents are made.
        metrics: names of metrics; None takes the usual ones.
        selection: whose recordings, of which days, and with which consent.
        comparable: class of runs whose numbers are compared; None takes the one with most recordings.

    Returns:
        Path: the file written.

    Raises:
        DataError: there are no recordings, or there is no such athlete, metric, scope or class.
    """
    with Database(season, selection) as database:
        page = season_page(season.name, gathered(database, metrics, comparable), database.selection)
    target = Path(path)
    if target.is_dir():
        target = target / "season.html"
    target.parent.mkdir(parents=True, exist_ok=True)
    write_file(target, page)
    return target


def season_page(name: str, found: SeasonPageData, selection: Selection) -> str:
    """The page as text."""
    sections = [
        ("changes", "What changed", changes_section(found)),
        ("sessions", "Sessions", heat_map(found)),
        ("trends", "Trends", trends_section(found)),
        ("health", "Sensor health", health_section(found)),
        ("failed", "Failed recordings", failed_section(found)),
        ("basis", "How to read this page", notes_list(_basis(found))),
    ]
    style = files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    heading = f"{name}: {selection.athlete}" if selection.athlete else f"Season: {name}"
    lead = f'<div class="lead">{_lead(found)}</div>{tiles(_figures(found))}'
    folded = ("trends",) if len(found.athletes) > 1 else ()
    return shell(heading, lead, sections, style=style, scripts=(sort_script(),), folded=folded)


def _lead(found: SeasonPageData) -> str:
    """Who rowed how much, what changed, whether it can be believed; a paragraph each."""
    return "".join(f"<p>{escape(text)}</p>" for text in (_rowed(found), _changed(found), _believed(found)))


def _rowed(found: SeasonPageData) -> str:
    count = Counter(row["athlete"] for row in found.recordings)
    days = [row["day"] for row in found.recordings if row["day"]]
    when = f" from {_day(min(days))} to {_day(max(days))}" if days else ""
    if len(count) == 1:
        name, sessions = count.most_common()[0]
        return f"{name} rowed {plural(sessions, 'session')}{when}."
    ordered = count.most_common()
    (most, many), (least, few) = ordered[0], ordered[-1]
    middle = ordered[len(ordered) // 2][1]
    each = (
        f"Each rowed {few}."
        if few == many
        else f"Most: {most} ({many}). Fewest: {least} ({few}). Median: {middle}."
    )
    return f"{plural(len(count), 'athlete')} rowed {plural(len(found.recordings), 'session')}{when}. {each}"


def _changed(found: SeasonPageData) -> str:
    if not found.compared:
        return "A change cannot be stated yet: that needs 4 months with results of one athlete."
    if not found.changes:
        return f"Nothing changed beyond chance, in {plural(len(found.compared), 'comparison')}."
    people = len({one.athlete for one in found.changes})
    metrics = Counter(shown_metric(one.metric).label for one in found.changes)
    most = ", ".join(f"{label} ({count})" for label, count in metrics.most_common(3))
    whose = f" of {plural(people, 'athlete')}" if len(found.athletes) > 1 else ""
    return (
        f"{plural(len(found.changes), 'change')}{whose} {'is' if len(found.changes) == 1 else 'are'} beyond chance "
        f"in {plural(len(found.compared), 'comparison')}. By metric: {most}."
    )


def _believed(found: SeasonPageData) -> str:
    failed, all_ = len(found.failed), len(found.recordings)
    texts = [
        f"{failed} of {plural(all_, 'recording')} failed ({100 * failed / all_:.1f} %)."
        if failed
        else "No recording failed."
    ]
    if waiting := sum(row["status"] not in ("done", "failed") for row in found.recordings):
        texts.append(
            f"Without a result yet: {plural(waiting, 'recording')}. Compute with oarlock season run."
        )
    if len(found.classes) > 1:
        others = sum(row["recordings"] for row in found.classes if row["comparable"] != found.comparable)
        used = next(row for row in found.classes if row["comparable"] == found.comparable)
        texts.append(
            f"Results of {len(found.classes)} classes, which engine, model, settings or calibration keep apart, must "
            f"not be compared. Trends and changes use class {found.comparable} "
            f"({plural(used['recordings'], 'recording')}); "
            f"{plural(others, 'recording')} of other classes are left out. To make them alike: oarlock season run."
        )
    elif found.classes:
        texts.append("All results are comparable: same engine, model, settings and kind of calibration.")
    return " ".join(texts)


def _figures(found: SeasonPageData) -> list[KeyFigure]:
    strokes = sum(row["strokes"] for row in found.recordings)
    time_s = sum(row["duration_s"] or 0.0 for row in found.recordings)
    chart = len(found.metrics)
    return [
        KeyFigure("Sessions", f"{len(found.recordings):,}", plural(len(found.athletes), "athlete")),
        KeyFigure("Strokes", f"{strokes:,}", f"in {duration(time_s)} of recordings"),
        KeyFigure("Changes beyond chance", str(len(found.changes)), f"in {plural(chart, 'metric')}"),
        KeyFigure(
            "Failed recordings",
            str(len(found.failed)),
            f"{100 * len(found.failed) / len(found.recordings):.1f} %",
        ),
    ]


def _basis(found: SeasonPageData) -> list[str]:
    return [
        "A stroke counts by its measured uncertainty, a session by its own and by how much sessions differ. Means are "
        "brought to the athlete's usual stroke rate.",
        "The bands do not contain an error that all sessions share, such as a wrong length. It cancels in changes.",
        "A table cannot say why something changed: a change of rig or the training of those weeks may be the cause.",
        "Metrics: "
        + ", ".join(shown_metric(name).label for name in found.metrics)
        + ". Choose others with --metric.",
        "Athletes appear by their pseudonyms. This file is a copy outside the season: after oarlock season erase, "
        "delete it and write it again.",
    ]


def _day(text: str) -> str:
    day = datetime.date.fromisoformat(text)
    return f"{day.day} {day:%b %Y}"
