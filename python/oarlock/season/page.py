"""`write_season_page`: a season as one HTML file: who rowed how much, what changed, and how far to trust it."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from itertools import groupby
from math import floor, log10
from pathlib import Path
from typing import Any

import numpy as np

from oarlock.report import markup, plot
from oarlock.report.markup import BAR_SWATCH, Column, grid, legend, notes_list, sort_script, table, value_cell
from oarlock.report.page import shell
from oarlock.report.plot import Panel
from oarlock.report.section import KeyFigure, tiles
from oarlock.report.text import DASH, fixed, number, plural
from oarlock.season.database import Database, Selection
from oarlock.season.questions import MONTHS_FOR_CHANGE, left_out, shown_metric
from oarlock.season.store import Season, not_in_season
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

FALSE_SHARE = 0.05
"""Expected share of false ones among the changes listed, at most."""
USUAL_METRICS = (
    "catch_angle_rad",
    "finish_angle_rad",
    "arc_rad",
    "seat_travel_m",
    "catch_factor_s",
    "rhythm",
)
"""Metrics of a page that asks for no others, as far as the season has them."""
_MOST = 4
"""Sessions a week with the darkest colour."""
_OPEN_ROWS, _DRAWN = 12, 3
"""Changes in the open list, and those that are drawn; the others are folded."""
_SIZE = (345.0, 190.0)
_PLACE = (40.0, 8.0, 297.0, 128.0)
_MOST_LABELS = 14
_MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]

Row = Mapping[str, Any]


def beyond_chance(comparisons: Sequence[Row], false_share: float = FALSE_SHARE) -> list[Row]:
    """Those that stay after a correction for the number of comparisons, largest against their band first.

    The procedure of Benjamini and Hochberg (1995) limits the expected share of false ones among those listed.
    """
    chances = np.sort([row["chance"] for row in comparisons])
    under = np.flatnonzero(chances <= false_share * np.arange(1, len(chances) + 1) / max(len(chances), 1))
    limit = chances[under[-1]] if len(under) else -1.0
    listed = [row for row in comparisons if row["chance"] <= limit]
    return sorted(listed, key=lambda row: (-against_band(row), row["athlete"], row["metric"]))


def against_band(row: Row) -> float:
    """Size of a change in half widths of its band; above 1 the band does not contain 0."""
    return float(abs(row["change"]) / max(0.5 * (row["high"] - row["low"]), 1e-300))


@dataclass(frozen=True)
class SeasonPageData:
    """What a page shows: rows of the questions of these names, in SI units and radians.

    `comparable` is the class of runs whose numbers are shown, `changes` are the comparisons beyond chance, `left_out`
    are sentences by metric.
    """

    athletes: Sequence[str]
    metrics: Sequence[str]
    recordings: Sequence[Row]
    classes: Sequence[Row]
    comparable: str | None
    trends: Mapping[tuple[str, str], Sequence[Row]]
    compared: Sequence[Row]
    changes: Sequence[Row]
    health: Sequence[Row]
    failed: Sequence[Row]
    left_out: Mapping[str, Sequence[str]]


def gathered(
    database: Database, metrics: Sequence[str] | None = None, comparable: str | None = None
) -> SeasonPageData:
    """Ask for everything; without names the usual metrics, without a class the one with most recordings."""
    recordings = database.rows(
        "SELECT athlete, strftime(started, '%Y-%m-%d') AS day, "
        "strftime(date_trunc('week', started), '%Y-%m-%d') AS week, duration_s, status, "
        "coalesce(strokes, 0) AS strokes, coalesce(left_out, 0) AS left_out, device "
        "FROM recordings ORDER BY athlete, started"
    )
    if not recordings:
        raise DataError(f"{database.selection}: has no recordings to show; add some: `oarlock season add`")
    classes = database.rows("FROM classes")
    names = [row["comparable"] for row in classes]
    if comparable is not None and comparable not in names:
        raise not_in_season("class of runs", comparable, names)
    shown = comparable or (names[0] if names else None)
    columns = [name for name in USUAL_METRICS if name in database.metrics] or list(database.metrics[:6])
    if metrics:
        columns = list(dict.fromkeys(database.metric(name) for name in metrics))
    columns = columns if shown else []
    trends: dict[tuple[str, str], list[Row]] = {}
    compared: list[Row] = []
    for column in columns:
        for row in database.rows(f"FROM trend('{column}')"):
            if row["comparable"] == shown and row["at_s"] is not None:
                trends.setdefault((row["athlete"], column), []).append(row)
        rows = database.rows(f"FROM comparisons('{column}')")
        compared += [row for row in rows if row["comparable"] == shown]
    return SeasonPageData(
        athletes=sorted({row["athlete"] for row in recordings}),
        metrics=columns,
        recordings=recordings,
        classes=classes,
        comparable=shown,
        trends=trends,
        compared=compared,
        changes=beyond_chance(compared),
        health=database.rows(
            "SELECT number, sum(recordings)::BIGINT AS recordings, sum(recordings * mean) / sum(recordings) AS mean, "
            "max(worst) AS worst, arg_max(athlete, worst) AS athlete, arg_max(month, worst) AS month, "
            "arg_max(worst_recording, worst) AS recording FROM sensor_health GROUP BY number ORDER BY number"
        ),
        failed=database.rows(
            "SELECT *, coalesce(strftime(started, '%Y-%m-%d'), '\N{EN DASH}') AS day FROM failed "
            "ORDER BY count(*) OVER (PARTITION BY fault) DESC, fault, started"
        ),
        left_out={column: left_out(database, "trend", column) for column in columns},
    )


def heat_map(data: SeasonPageData) -> str:
    """The table; a week with a failed recording has a mark at its foot."""
    known = [row["week"] for row in data.recordings if row["week"]]
    if not known:
        return "<p>No recording has a date.</p>"
    first, last = (datetime.date.fromisoformat(end) for end in (min(known), max(known)))
    weeks = [str(first + datetime.timedelta(weeks=k)) for k in range((last - first).days // 7 + 1)]
    changes = Counter(row["athlete"] for row in data.changes)
    rows = []
    for name, group in groupby(data.recordings, key=lambda row: str(row["athlete"])):
        own = list(group)
        strokes = sum(row["strokes"] - row["left_out"] for row in own)
        counts = [value_cell(len(own), f"{len(own):,}"), value_cell(strokes, f"{strokes:,}")]
        changed = value_cell(changes[name], str(changes[name] or ""))
        rows.append([escape(name), _cells(name, own, weeks), *counts, changed])
    names = ["none", *(f"{k} a week" for k in range(1, _MOST)), f"{_MOST} or more"]
    swatches = [(f'<rect class="heat-{k}" width="14" height="10"/>', name) for k, name in enumerate(names)]
    swatches.append(('<rect class="heat-failed" y="6" width="14" height="4"/>', "a recording failed"))
    heads = [
        Column("Athlete"),
        Column("Weeks", f"{_day(weeks[0])[-8:]} to {_day(weeks[-1])[-8:]}"),
        Column("Sessions", meaning="Recordings with and without a result"),
        Column("Strokes", meaning="Those that count in means"),
        Column("Changes", meaning="Changes that are listed below"),
    ]
    caption = (
        "One cell is a week, stronger with more sessions. Hover a cell for its numbers. A heading sorts."
    )
    return legend(swatches, BAR_SWATCH) + table("heat", caption, heads, rows, style="sortable heat")


def _cells(name: str, rows: Sequence[Row], weeks: Sequence[str]) -> str:
    count = Counter(row["week"] for row in rows)
    failed = Counter(row["week"] for row in rows if row["status"] == "failed")
    parts = [f'<rect class="heat-0" width="{len(weeks)}" height="10"/>']
    rowed = [(k, week) for k, week in enumerate(weeks) if count[week]]
    for k, week in rowed:
        lost = f", {failed[week]} failed" if failed[week] else ""
        words = f"<title>Week of {week}: {plural(count[week], 'session')}{lost}</title>"
        place = f'x="{k}" width="1"'
        parts.append(f'<rect class="heat-{min(count[week], _MOST)}" {place} height="10">{words}</rect>')
        parts += [f'<rect class="heat-failed" {place} y="6" height="4"/>'] if lost else []
    active = f"{escape(name)}: rowed in {plural(len(rowed), 'week')} of {len(weeks)}"
    box = f'viewBox="0 0 {len(weeks)} 10" preserveAspectRatio="none"'
    return f'<svg class="weeks" {box} role="img" aria-label="{active}">{"".join(parts)}</svg>'


def trend_chart(key: str, athlete: str, metric: str, rows: Sequence[Row]) -> str:
    """A chart; `rows` are months of the question `trend`."""
    shown = shown_metric(metric)
    x = np.array([12 * int(row["month"][:4]) + int(row["month"][5:]) - 1 for row in rows], dtype=float)
    values = np.array([[row[name] for name in ("mean", "low", "high")] for row in rows], dtype=float)
    mean, low, high = shown.scale * values.T
    span = (float(x.min()) - 0.5, float(x.max()) + 0.5)
    panel = Panel(*_PLACE, span, plot.padded([mean, low, high], least=1e-6))
    bars, dots = [], []
    for at, value, bottom, top, row in zip(panel.x(x), mean, low, high, rows, strict=True):
        band = "no band: no month has two sessions"
        if np.isfinite(bottom):
            band = f"{bottom:.4g} to {top:.4g}"
            ends = f"{float(panel.y(bottom)):.1f}V{float(panel.y(top)):.1f}"
            bars.append(f'<path class="interval" d="M{at:.1f} {ends}"/>')
        words = f"{row['month']}: {value:.4g} {shown.unit} ({band}), n = {row['sessions']}"
        place = f'cx="{at:.1f}" cy="{float(panel.y(value)):.1f}" r="2.8"'
        dots.append(f'<circle class="dot s0" {place}><title>{escape(words)}</title></circle>')
    line = plot.line(panel, x, mean, "series s0")
    content = "".join([_axes(panel, x, [row["sessions"] for row in rows]), *bars, line, *dots])
    title = f"{athlete}: {shown.label}"
    drawing = plot.drawing(key, _SIZE, title, f"Mean of each month with 95 % band, {shown.unit}", content)
    return markup.figure(title, drawing, unit=shown.unit)


def _axes(panel: Panel, x: Floats, sessions: Sequence[int]) -> str:
    """Grid of the values, names of the months, and numbers of sessions."""
    values, parts = plot.ticks(*panel.y_range, wanted=4), []
    for value, name in zip(values, plot.tick_labels(values), strict=True):
        y = float(panel.y(value))
        parts.append(f'<path class="grid" d="M{panel.left:g} {y:.1f}h{panel.width:g}"/>')
        parts.append(plot.label(panel.left - 5, y + 3.5, name, anchor="end"))
    bottom, every = panel.top + panel.height, 1 + (len(x) - 1) // _MOST_LABELS
    parts.append(plot.label(panel.left - 5, bottom + 33, "n", anchor="end"))
    letters = 3 if len(x) <= 9 else 1
    for k in range(0, len(x), every):
        at, name = float(panel.x(x[k])), _MONTHS[int(x[k]) % 12][:letters]
        parts.append(plot.label(at, bottom + 17, name, "", "middle"))
        parts.append(plot.label(at, bottom + 33, str(sessions[k]), "", "middle"))
    first, last = (f"{_MONTHS[int(month) % 12]} {int(month) // 12}" for month in (x[0], x[-1]))
    parts.append(plot.label(panel.left, bottom + 49, first))
    parts += [plot.label(panel.left + panel.width, bottom + 49, last, anchor="end")] if len(x) > 1 else []
    return "".join(parts)


def changes_section(data: SeasonPageData) -> str:
    """Changes beyond chance, largest against their band first."""
    if not data.changes:
        return f"<p>{_changed(data)}</p>"
    count = len(data.changes)
    caption = (
        f"The largest {_OPEN_ROWS} of {count} changes." if count > _OPEN_ROWS else plural(count, "change")
    )
    content = (
        '<p class="hint">Each athlete is compared with itself: months over the season, and 60 days after a change of '
        f"rig with 60 days before. {plural(len(data.compared), 'comparison')} were made, so some would be beyond "
        "their 95 % band by chance alone. The list is corrected for that (Benjamini and Hochberg 1995): of the changes "
        "listed, about 1 in 20 is expected to be false. The largest against its band comes first.</p>"
        + _changes_table("changes", data.changes[:_OPEN_ROWS], caption)
    )
    largest = list(dict.fromkeys((row["athlete"], row["metric"]) for row in data.changes))[:_DRAWN]
    if rest := data.changes[_OPEN_ROWS:]:
        content += (
            f"<details><summary>{plural(len(rest), 'smaller change')}</summary>"
            f"{_changes_table('more-changes', rest, 'The others, in the same order.')}</details>"
        )
    return content + grid(
        trend_chart(f"changed-{k}", *whose, data.trends[whose])
        for k, whose in enumerate(largest)
        if whose in data.trends
    )


def _changes_table(key: str, changes: Sequence[Row], caption: str) -> str:
    heads = (
        Column("Athlete"),
        Column("Metric"),
        Column("Change"),
        Column("95 % band"),
        Column("Against band", meaning="Size of the change in half widths of its band"),
        Column("n", meaning="Sessions"),
        Column("From, to"),
    )
    return table(key, caption, heads, list(map(_change_row, changes)), style="sortable changes")


def _change_row(row: Row) -> list[str]:
    shown = shown_metric(row["metric"])
    change, low, high = (shown.scale * row[key] for key in ("change", "low", "high"))
    # Decimals that show the band with two digits.
    places = 3 if high <= low else max(0, min(4, 1 - floor(log10(high - low))))
    return [
        escape(row["athlete"]),
        escape(shown.label + ("" if row["kind"] == "trend" else " (rig)")),
        value_cell(change, f"{'+' if change > 0 else ''}{fixed(change, places)} {shown.unit}".rstrip()),
        escape(f"{fixed(low, places)} to {fixed(high, places)}"),
        value_cell(against_band(row), f"{against_band(row):.1f}"),
        value_cell(row["sessions"], str(row["sessions"])),
        escape(row["period"]),
    ]


def trends_section(data: SeasonPageData) -> str:
    """Trends of all metrics, of several athletes each is folded; and what is in none."""
    changes = Counter(row["athlete"] for row in data.changes)
    parts = ['<p class="hint">Means of months with 95 % bands; n is the number of sessions.</p>']
    for k, name in enumerate(data.athletes):
        content = grid(
            trend_chart(f"trend-{k}-{j}", name, metric, rows)
            for j, metric in enumerate(data.metrics)
            if (rows := data.trends.get((name, metric)))
        )
        content = content or "<p>No session with a date has 10 strokes that count.</p>"
        if len(data.athletes) > 1:
            more = f", {plural(changes[name], 'change')}" if changes[name] else ""
            content = f"<details><summary>{escape(name)}{more}</summary>{content}</details>"
        parts.append(content)
    for metric, sentences in data.left_out.items():
        label = f"Left out of {escape(shown_metric(metric).label)}"
        parts += (
            [f"<details><summary>{label}</summary>{notes_list(sentences)}</details>"] if sentences else []
        )
    return "".join(parts)


def health_section(data: SeasonPageData) -> str:
    """Numbers about the sensors: mean over all recordings, and the worst recording."""
    if not data.health:
        return "<p>The results contain no numbers about the sensors.</p>"
    rows = []
    for row in data.health:
        name, worst = row["number"], row["worst"]
        label, values = name, [number(value) for value in (row["mean"], worst)]
        if name.endswith("_share"):
            label = name.removesuffix("_share").replace("_", " ")
            values = [f"{100.0 * value:.2f} %" for value in (row["mean"], worst)]
        where = [row["athlete"], row["month"], row["recording"][:8]]
        rows.append([escape(label), f"{row['recordings']:,}", *values, *map(escape, where)])
    caption = "A large worst value names the recording to look at first."
    heads = ("Number", Column("Recordings"), Column("Mean"), Column("Worst"), "Athlete", "Month", "Recording")
    return table("sensors", caption, heads, rows)


def failed_section(data: SeasonPageData) -> str:
    """Recordings without a result, by reason."""
    parts = []
    for k, (fault, group) in enumerate(groupby(data.failed, key=lambda row: str(row["fault"]))):
        rows = [
            [escape(row["recording"][:8]), escape(row["source"] or DASH), escape(row["athlete"]), row["day"]]
            for row in group
        ]
        listed = table(f"failed-{k}", fault, ("Recording", "Source", "Athlete", "Day"), rows)
        title = f"{plural(len(rows), 'recording')}: {escape(fault)}"
        parts.append(f"<details><summary>{title}</summary>{listed}</details>")
    return "".join(parts) or "<p>No recording failed.</p>"


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
    target = target / "season.html" if target.is_dir() else target
    target.parent.mkdir(parents=True, exist_ok=True)
    write_file(target, page)
    return target


def season_page(name: str, data: SeasonPageData, selection: Selection) -> str:
    """The page as text."""
    sections = [
        ("changes", "What changed", changes_section(data)),
        ("sessions", "Sessions", heat_map(data)),
        ("trends", "Trends", trends_section(data)),
        ("health", "Sensor health", health_section(data)),
        ("failed", "Failed recordings", failed_section(data)),
        ("basis", "How to read this page", notes_list(_basis(data))),
    ]
    style = files("oarlock.season").joinpath("page.css").read_text(encoding="utf-8")
    heading = f"{name}: {selection.athlete}" if selection.athlete else f"Season: {name}"
    paragraphs = "".join(f"<p>{escape(text)}</p>" for text in (_rowed(data), _changed(data), _believed(data)))
    lead = f'<div class="lead">{paragraphs}</div>{tiles(_figures(data))}'
    folded = ("trends",) if len(data.athletes) > 1 else ()
    return shell(heading, lead, sections, style=style, scripts=(sort_script(),), folded=folded)


def _rowed(data: SeasonPageData) -> str:
    days = [row["day"] for row in data.recordings if row["day"]]
    when = f" from {_day(min(days))} to {_day(max(days))}" if days else ""
    who = data.athletes[0] if len(data.athletes) == 1 else plural(len(data.athletes), "athlete")
    return f"{who} rowed {plural(len(data.recordings), 'session')}{when}."


def _changed(data: SeasonPageData) -> str:
    if not data.compared:
        return f"A change cannot be stated yet: that needs {MONTHS_FOR_CHANGE} months with results of one athlete."
    comparisons = plural(len(data.compared), "comparison")
    if not data.changes:
        return f"Nothing changed beyond chance, in {comparisons}."
    people = len({row["athlete"] for row in data.changes})
    metrics = Counter(shown_metric(row["metric"]).label for row in data.changes)
    most = ", ".join(f"{label} ({count})" for label, count in metrics.most_common(3))
    whose = f" of {plural(people, 'athlete')}" if len(data.athletes) > 1 else ""
    are = "is" if len(data.changes) == 1 else "are"
    changes = plural(len(data.changes), "change")
    return f"{changes}{whose} {are} beyond chance in {comparisons}. By metric: {most}."


def _believed(data: SeasonPageData) -> str:
    recordings = plural(len(data.recordings), "recording")
    failed, share = len(data.failed), 100.0 * len(data.failed) / len(data.recordings)
    texts = [f"{failed} of {recordings} failed ({share:.1f} %)." if failed else "No recording failed."]
    if waiting := sum(row["status"] == "waiting" for row in data.recordings):
        texts.append(
            f"Without a result yet: {plural(waiting, 'recording')}. Compute with oarlock season run."
        )
    if len(data.classes) > 1:
        counts = {row["comparable"]: row["recordings"] for row in data.classes}
        used = counts.pop(data.comparable)
        texts.append(
            f"Results of {len(data.classes)} classes, which engine, model, settings or calibration keep apart, must "
            f"not be compared. Trends and changes use class {data.comparable} ({plural(used, 'recording')}); "
            f"{plural(sum(counts.values()), 'recording')} of other classes are left out. To make them alike: "
            "oarlock season run."
        )
    elif data.classes:
        texts.append("All results have the same engine, model, settings and kind of calibration.")
    devices = sorted({str(row["device"]) for row in data.recordings if row["device"]})
    if len(devices) > 1:
        texts.append(
            f"They come from {len(devices)} kinds of device ({', '.join(devices)}), whose power, angles and distances "
            "may mean different things: compare numbers of one device only."
        )
    return " ".join(texts)


def _figures(data: SeasonPageData) -> list[KeyFigure]:
    beside = sum(row["left_out"] for row in data.recordings)
    strokes = sum(row["strokes"] for row in data.recordings) - beside
    time_s = sum(row["duration_s"] or 0.0 for row in data.recordings)
    time = f"{time_s / 3600.0:,.0f} h" if time_s >= 7200.0 else f"{time_s / 60.0:.0f} min"
    others = f"; {beside:,} more do not count" if beside else ""
    metrics, failed = plural(len(data.metrics), "metric"), len(data.failed)
    return [
        KeyFigure("Sessions", f"{len(data.recordings):,}", plural(len(data.athletes), "athlete")),
        KeyFigure("Strokes", f"{strokes:,}", f"in {time} of recordings{others}"),
        KeyFigure("Changes beyond chance", str(len(data.changes)), f"in {metrics}"),
        KeyFigure("Failed recordings", str(failed), f"{100 * failed / len(data.recordings):.1f} %"),
    ]


def _basis(data: SeasonPageData) -> list[str]:
    return [
        "A stroke counts by its measured uncertainty, a session by its own and by how much sessions differ. Means are "
        "brought to the athlete's usual stroke rate. Misread strokes, paddling and starts count in no mean.",
        "The bands do not contain an error that all sessions share, such as a wrong length. It cancels in changes.",
        "A table cannot say why something changed: a change of rig or the training of those weeks may be the cause.",
        "Metrics: "
        + ", ".join(shown_metric(name).label for name in data.metrics)
        + ". Choose others with --metric.",
        "Athletes appear by their pseudonyms. This file is a copy outside the season: after oarlock season erase, "
        "delete it and write it again.",
    ]


def _day(text: str) -> str:
    day = datetime.date.fromisoformat(text)
    return f"{day.day} {day:%b %Y}"
