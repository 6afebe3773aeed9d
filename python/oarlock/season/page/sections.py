"""Sections of a season's page: changes, trends, sensors and failed recordings."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import groupby
from math import floor, log10

from oarlock.report.markup import Column, grid, table
from oarlock.report.sortable import value_cell
from oarlock.report.text import DASH, fixed, number, plural
from oarlock.season.page.charts import trend_chart
from oarlock.season.page.findings import AthleteComparison
from oarlock.season.page.gather import Row, SeasonPageData
from oarlock.season.questions.shown import shown_metric

OPEN_ROWS, DRAWN = 12, 3
"""Changes in the open list, and those that are drawn; the others are folded."""


def changes_section(found: SeasonPageData) -> str:
    """Changes beyond chance, largest against their band first."""
    if not found.changes:
        return f"<p>No change is beyond chance among {plural(len(found.compared), 'comparison')}.</p>"
    content = _explained(found) + _changes_table("changes", found.changes[:OPEN_ROWS], _counted(found))
    drawn = [
        trend_chart(f"changed-{k}", one.athlete, one.metric, rows)
        for k, one in enumerate(_drawn(found))
        if (rows := found.trends.get((one.athlete, one.metric)))
    ]
    if rest := found.changes[OPEN_ROWS:]:
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
        cells = [[escape(row["recording"][:8]), escape(row["athlete"]), _date(row)] for row in rows]
        listed = table(f"failed-{k}", fault, ("Recording", "Athlete", "Day"), cells)
        title = f"{plural(len(rows), 'recording')}: {escape(fault)}"
        parts.append(f"<details><summary>{title}</summary>{listed}</details>")
    return "".join(parts)


def _explained(found: SeasonPageData) -> str:
    return (
        '<p class="hint">Each athlete is compared with itself: months over the season, and 60 days after a change of '
        f"rig with 60 days before. {plural(len(found.compared), 'comparison')} were made, so some would be beyond "
        "their 95 % band by chance alone. The list is corrected for that (Benjamini and Hochberg 1995): of the changes "
        "listed, about 1 in 20 is expected to be false. The largest against its band comes first.</p>"
    )


def _counted(found: SeasonPageData) -> str:
    count = len(found.changes)
    return plural(count, "change") if count <= OPEN_ROWS else f"The largest {OPEN_ROWS} of {count} changes."


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


def _drawn(found: SeasonPageData) -> list[AthleteComparison]:
    """The largest changes, of each athlete and metric once."""
    unique: dict[tuple[str, str], AthleteComparison] = {}
    for one in found.changes:
        unique.setdefault((one.athlete, one.metric), one)
    return list(unique.values())[:DRAWN]


def _health_row(name: str, rows: Sequence[Row]) -> list[str]:
    recordings = sum(row["recordings"] for row in rows)
    mean = sum(row["recordings"] * row["mean"] for row in rows) / recordings
    worst = max(rows, key=lambda row: float(row["worst"]))
    share = name.endswith("_share")
    values = [f"{100 * value:.2f} %" if share else number(value) for value in (mean, worst["worst"])]
    label = name.removesuffix("_share").replace("_", " ") if share else name
    where = [escape(str(worst[name] or DASH)) for name in ("athlete", "month")]
    return [escape(label), f"{recordings:,}", *values, *where, escape(worst["worst_recording"][:8])]


def _date(row: Row) -> str:
    return DASH if row["started"] is None else f"{row['started']:%Y-%m-%d}"


def _places(width: float) -> int:
    """Decimals that show a band with two digits."""
    return 3 if width <= 0.0 else max(0, min(4, 1 - floor(log10(width))))
