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
from oarlock.report.markup import BAR_SWATCH, Column, grid, legend, notes_list, table
from oarlock.report.page import shell
from oarlock.report.plot import Floats, Panel
from oarlock.report.section import KeyFigure, tiles
from oarlock.report.sortable import sort_script, value_cell
from oarlock.report.text import DASH, fixed, number, plural
from oarlock.season.database import Database, Selection
from oarlock.season.questions import MONTHS_FOR_CHANGE, shown_metric
from oarlock.season.store import Season, not_in_season
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


@dataclass(frozen=True)
class AthleteComparison:
    """A change of an athlete with its 95 % band, in the unit of the column.

    Its kind is "trend", from the first month to the last, or "rig", after a change of rig against before. `chance` is
    the probability of a change of this size or larger without a true one (two-sided).
    """

    athlete: str
    metric: str
    kind: str
    change: float
    low: float
    high: float
    chance: float
    sessions: int
    period: str

    @property
    def against_band(self) -> float:
        """Size of the change in half widths of its band; above 1 the band does not contain 0."""
        return abs(self.change) / max(0.5 * (self.high - self.low), 1e-300)


def _comparison(metric: str, kind: str, row: Row) -> AthleteComparison | None:
    """A row of the question `changes` or `rig`; None if there are too few months or sessions."""
    from scipy.special import stdtr

    if row["se"] is None or not row["se"] > 0.0 or row["low"] is None:
        return None
    if kind == "trend":
        if row["months"] < MONTHS_FOR_CHANGE or not row["per_month"]:
            return None
        scale, freedom, sessions = row["change"] / row["per_month"], row["months"] - 2, row["sessions"]
        period = f"{row['first_month']} to {row['last_month']}"
    else:
        before, after = row["n_before"], row["n_after"]
        scale, freedom, sessions = 1.0, min(before, after) - 1, before + after
        period = f"{row['before']} to {row['after']}, {row['day']}"
    chance = 2.0 * float(stdtr(max(freedom, 1), -abs(row["change"] / (row["se"] * scale))))
    low, high = row["low"] * scale, row["high"] * scale
    return AthleteComparison(row["athlete"], metric, kind, row["change"], low, high, chance, sessions, period)


def beyond_chance(
    comparisons: Sequence[AthleteComparison], false_share: float = FALSE_SHARE
) -> list[AthleteComparison]:
    """Those that stay after a correction for the number of comparisons, largest against their band first.

    The procedure of Benjamini and Hochberg (1995) limits the expected share of false ones among those listed.
    """
    chances = np.sort(np.array([one.chance for one in comparisons]))
    limits = false_share * np.arange(1, len(chances) + 1) / max(len(chances), 1)
    under = np.flatnonzero(chances <= limits)
    if not len(under):
        return []
    limit = chances[under[-1]]
    found = [one for one in comparisons if one.chance <= limit]
    return sorted(found, key=lambda one: (-one.against_band, one.athlete, one.metric))


@dataclass(frozen=True)
class SeasonPageData:
    """What a page shows: rows of the questions of these names, in SI units and radians.

    `comparable` is the class of runs whose numbers are shown, `changes` are the comparisons beyond chance.
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
    """Ask for everything; without names the usual metrics, without a class the one with most recordings."""
    recordings = database.table(
        "SELECT athlete, started, strftime(started, '%Y-%m-%d') AS day, "
        "strftime(date_trunc('week', started), '%Y-%m-%d') AS week, duration_s, status, "
        "coalesce(strokes, 0) AS strokes, comparable FROM recordings ORDER BY athlete, started"
    ).to_pylist()
    if not recordings:
        raise DataError(f"{database.selection}: has no recordings to show; add some: `oarlock season add`")
    classes = database.table("FROM classes").to_pylist()
    names = [row["comparable"] for row in classes]
    if comparable is not None and comparable not in names:
        raise not_in_season("class of runs", comparable, names)
    shown = comparable or (names[0] if names else None)
    columns: list[str] = []
    if shown and metrics:
        columns = list(dict.fromkeys(database.metric(name) for name in metrics))
    elif shown:
        usual = [name for name in USUAL_METRICS if name in database.metrics]
        columns = usual or list(database.metrics[:6])
    trends: dict[tuple[str, str], list[Row]] = {}
    compared: list[AthleteComparison] = []
    for column in columns:
        for question, kind in (("trend", ""), ("changes", "trend"), ("rig", "rig")):
            for row in database.table(f"FROM {question}('{column}')").to_pylist():
                if row["comparable"] != shown:
                    continue
                if not kind:
                    trends.setdefault((row["athlete"], column), []).append(row)
                elif (found := _comparison(column, kind, row)) is not None:
                    compared.append(found)
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


def heat_map(found: SeasonPageData) -> str:
    """The table; a week with a failed recording has a mark at its foot."""
    known = [row["week"] for row in found.recordings if row["week"]]
    if not known:
        return "<p>No recording has a date.</p>"
    first, last = (datetime.date.fromisoformat(end) for end in (min(known), max(known)))
    weeks = [str(first + datetime.timedelta(weeks=k)) for k in range((last - first).days // 7 + 1)]
    by_athlete: dict[str, list[Row]] = {name: [] for name in found.athletes}
    for row in found.recordings:
        by_athlete[row["athlete"]].append(row)
    changes = Counter(one.athlete for one in found.changes)
    rows = []
    for name, own in by_athlete.items():
        strokes = sum(row["strokes"] for row in own)
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
        Column("Strokes"),
        Column("Changes", meaning="Changes that are listed below"),
    ]
    caption = (
        "One cell is a week, stronger with more sessions. Hover a cell for its numbers. A heading sorts."
    )
    return legend(swatches, BAR_SWATCH) + table("heat", caption, heads, rows, style="sortable heat")


def _cells(name: str, rows: Sequence[Row], weeks: Sequence[str]) -> str:
    count = Counter(row["week"] for row in rows)
    failed = Counter(row["week"] for row in rows if row["status"] == "failed")
    parts = []
    for k, week in enumerate(weeks):
        if not count[week]:
            continue
        lost = f", {failed[week]} failed" if failed[week] else ""
        words = f"<title>Week of {week}: {plural(count[week], 'session')}{lost}</title>"
        parts.append(
            f'<rect class="heat-{min(count[week], _MOST)}" x="{k}" width="1" height="10">{words}</rect>'
        )
        if failed[week]:
            parts.append(f'<rect class="heat-failed" x="{k}" y="6" width="1" height="4"/>')
    active = plural(sum(1 for week in weeks if count[week]), "week")
    return (
        f'<svg class="weeks" viewBox="0 0 {len(weeks)} 10" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(name)}: rowed in {active} of {len(weeks)}">'
        f'<rect class="heat-0" width="{len(weeks)}" height="10"/>{"".join(parts)}</svg>'
    )


def trend_chart(key: str, athlete: str, metric: str, rows: Sequence[Row]) -> str:
    """A chart; `rows` are months of the question `trend`."""
    shown = shown_metric(metric)
    x = np.array([12 * int(row["month"][:4]) + int(row["month"][5:]) - 1 for row in rows], dtype=float)
    mean, low, high = (
        shown.scale * np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=float)
        for name in ("mean", "low", "high")
    )
    span = (float(x.min()) - 0.5, float(x.max()) + 0.5)
    panel = Panel(*_PLACE, span, plot.padded([mean, low, high], least=1e-6))
    content = _grid(panel) + _month_names(panel, x, [row["sessions"] for row in rows])
    dots = []
    for a, value, b, c, row in zip(x, mean, low, high, rows, strict=True):
        at = f"{float(panel.x(a)):.1f}"
        if np.isfinite(b) and np.isfinite(c):
            ends = f"{float(panel.y(b)):.1f}V{float(panel.y(c)):.1f}"
            content += f'<path class="interval" d="M{at} {ends}"/>'
        words = f"{row['month']}: {value:.4g} {shown.unit} ({b:.4g} to {c:.4g}), n = {row['sessions']}"
        place = f'cx="{at}" cy="{float(panel.y(value)):.1f}" r="2.8"'
        dots.append(f'<circle class="dot s0" {place}><title>{escape(words)}</title></circle>')
    content += plot.line(panel, x, mean, "series s0") + "".join(dots)
    drawn = plot.drawing(
        key, _SIZE, f"{athlete}: {shown.label}", f"Mean of each month with 95 % band, {shown.unit}", content
    )
    return markup.figure(f"{athlete}: {shown.label}", drawn, unit=shown.unit)


def _grid(panel: Panel) -> str:
    values = plot.ticks(*panel.y_range, wanted=4)
    return "".join(
        f'<path class="grid" d="M{panel.left:g} {float(panel.y(value)):.1f}h{panel.width:g}"/>'
        + plot.label(panel.left - 5, float(panel.y(value)) + 3.5, name, anchor="end")
        for value, name in zip(values, plot.tick_labels(values), strict=True)
    )


def _month_names(panel: Panel, x: Floats, sessions: Sequence[int]) -> str:
    bottom, every = panel.top + panel.height, 1 + (len(x) - 1) // _MOST_LABELS
    parts = [plot.label(panel.left - 5, bottom + 33, "n", anchor="end")]
    for k in range(0, len(x), every):
        at, month = float(panel.x(x[k])), int(x[k])
        parts.append(
            plot.label(at, bottom + 17, _MONTHS[month % 12][: 3 if len(x) <= 9 else 1], "", "middle")
        )
        parts.append(plot.label(at, bottom + 33, str(sessions[k]), "", "middle"))
    first, last = (f"{_MONTHS[int(one) % 12]} {int(one) // 12}" for one in (x[0], x[-1]))
    parts.append(plot.label(panel.left, bottom + 49, first))
    if len(x) > 1:
        parts.append(plot.label(panel.left + panel.width, bottom + 49, last, anchor="end"))
    return "".join(parts)


def changes_section(found: SeasonPageData) -> str:
    """Changes beyond chance, largest against their band first."""
    if not found.changes:
        return f"<p>No change is beyond chance among {plural(len(found.compared), 'comparison')}.</p>"
    count = len(found.changes)
    caption = plural(count, "change")
    if count > _OPEN_ROWS:
        caption = f"The largest {_OPEN_ROWS} of {count} changes."
    content = (
        '<p class="hint">Each athlete is compared with itself: months over the season, and 60 days after a change of '
        f"rig with 60 days before. {plural(len(found.compared), 'comparison')} were made, so some would be beyond "
        "their 95 % band by chance alone. The list is corrected for that (Benjamini and Hochberg 1995): of the changes "
        "listed, about 1 in 20 is expected to be false. The largest against its band comes first.</p>"
        + _changes_table("changes", found.changes[:_OPEN_ROWS], caption)
    )
    largest = list(dict.fromkeys((one.athlete, one.metric) for one in found.changes))[:_DRAWN]
    drawn = [
        trend_chart(f"changed-{k}", *one, found.trends[one])
        for k, one in enumerate(largest)
        if one in found.trends
    ]
    if rest := found.changes[_OPEN_ROWS:]:
        content += (
            f"<details><summary>{plural(len(rest), 'smaller change')}</summary>"
            f"{_changes_table('more-changes', rest, 'The others, in the same order.')}</details>"
        )
    return content + grid(drawn)


def trends_section(found: SeasonPageData) -> str:
    """Trends of all metrics; of several athletes each is folded."""
    changes = {name: sum(one.athlete == name for one in found.changes) for name in found.athletes}
    parts = ['<p class="hint">Means of months with 95 % bands; n is the number of sessions.</p>']
    for k, name in enumerate(found.athletes):
        charts = [
            trend_chart(f"trend-{k}-{j}", name, metric, rows)
            for j, metric in enumerate(found.metrics)
            if (rows := found.trends.get((name, metric)))
        ]
        content = grid(charts) if charts else "<p>No session has 10 strokes or more.</p>"
        if len(found.athletes) > 1:
            more = f", {plural(changes[name], 'change')}" if changes[name] else ""
            content = f"<details><summary>{escape(name)}{more}</summary>{content}</details>"
        parts.append(content)
    return "".join(parts)


def health_section(found: SeasonPageData) -> str:
    """Numbers about the sensors: mean over all recordings, and the worst recording."""
    if not found.health:
        return "<p>The results contain no numbers about the sensors.</p>"
    ordered = sorted(found.health, key=lambda row: str(row["number"]))
    rows = [
        _health_row(name, list(group)) for name, group in groupby(ordered, key=lambda row: str(row["number"]))
    ]
    caption = "A large worst value names the recording to look at first."
    heads = ("Number", Column("Recordings"), Column("Mean"), Column("Worst"), "Athlete", "Month", "Recording")
    return table("sensors", caption, heads, rows)


def failed_section(found: SeasonPageData) -> str:
    """Recordings without a result, by reason."""
    if not found.failed:
        return "<p>No recording failed.</p>"
    parts = []
    ordered = sorted(found.failed, key=lambda row: str(row["fault"]))
    groups = [(fault, list(rows)) for fault, rows in groupby(ordered, key=lambda row: str(row["fault"]))]
    for k, (fault, rows) in enumerate(sorted(groups, key=lambda group: -len(group[1]))):
        cells = [
            [escape(row["recording"][:8]), escape(row["athlete"]), f"{row['started'] or DASH!s:.10}"]
            for row in rows
        ]
        listed = table(f"failed-{k}", fault, ("Recording", "Athlete", "Day"), cells)
        title = f"{plural(len(rows), 'recording')}: {escape(fault)}"
        parts.append(f"<details><summary>{title}</summary>{listed}</details>")
    return "".join(parts)


def _changes_table(key: str, changes: Sequence[AthleteComparison], caption: str) -> str:
    heads = (
        Column("Athlete"),
        Column("Metric"),
        Column("Change"),
        Column("95 % band"),
        Column("Against band", meaning="Size of the change in half widths of its band"),
        Column("n", meaning="Sessions"),
        Column("From, to"),
    )
    return table(key, caption, heads, [_change_row(one) for one in changes], style="sortable changes")


def _change_row(one: AthleteComparison) -> list[str]:
    shown = shown_metric(one.metric)
    change, low, high = (shown.scale * value for value in (one.change, one.low, one.high))
    places = _places(high - low)
    return [
        escape(one.athlete),
        escape(shown.label + ("" if one.kind == "trend" else " (rig)")),
        value_cell(change, f"{'+' if change > 0 else ''}{fixed(change, places)} {shown.unit}".rstrip()),
        escape(f"{fixed(low, places)} to {fixed(high, places)}"),
        value_cell(one.against_band, f"{one.against_band:.1f}"),
        value_cell(one.sessions, str(one.sessions)),
        escape(one.period),
    ]


def _health_row(name: str, rows: Sequence[Row]) -> list[str]:
    recordings = sum(row["recordings"] for row in rows)
    mean = sum(row["recordings"] * row["mean"] for row in rows) / recordings
    worst = max(rows, key=lambda row: float(row["worst"]))
    share = name.endswith("_share")
    values = [f"{100 * value:.2f} %" if share else number(value) for value in (mean, worst["worst"])]
    label = name.removesuffix("_share").replace("_", " ") if share else name
    where = [escape(str(worst[name] or DASH)) for name in ("athlete", "month")]
    return [escape(label), f"{recordings:,}", *values, *where, escape(worst["worst_recording"][:8])]


def _places(width: float) -> int:
    """Decimals that show a band with two digits."""
    return 3 if width <= 0.0 else max(0, min(4, 1 - floor(log10(width))))


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
    style = files("oarlock.season").joinpath("page.css").read_text(encoding="utf-8")
    heading = f"{name}: {selection.athlete}" if selection.athlete else f"Season: {name}"
    texts = (_rowed(found), _changed(found), _believed(found))
    paragraphs = "".join(f"<p>{escape(text)}</p>" for text in texts)
    lead = f'<div class="lead">{paragraphs}</div>{tiles(_figures(found))}'
    folded = ("trends",) if len(found.athletes) > 1 else ()
    return shell(heading, lead, sections, style=style, scripts=(sort_script(),), folded=folded)


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
    time = f"{time_s / 3600.0:,.0f} h" if time_s >= 7200.0 else f"{time_s / 60.0:.0f} min"
    failed = len(found.failed)
    return [
        KeyFigure("Sessions", f"{len(found.recordings):,}", plural(len(found.athletes), "athlete")),
        KeyFigure("Strokes", f"{strokes:,}", f"in {time} of recordings"),
        KeyFigure(
            "Changes beyond chance", str(len(found.changes)), f"in {plural(len(found.metrics), 'metric')}"
        ),
        KeyFigure("Failed recordings", str(failed), f"{100 * failed / len(found.recordings):.1f} %"),
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
