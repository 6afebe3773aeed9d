"""The heat map of a season's page: one row an athlete, one cell a week, with totals that sort."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Sequence
from html import escape

from oarlock.report.markup import BAR_SWATCH, Column, legend, table
from oarlock.report.sortable import value_cell
from oarlock.report.text import plural
from oarlock.season.page.gather import Row, SeasonPageData

MOST = 4
"""Sessions a week with the darkest colour."""


def heat_map(found: SeasonPageData) -> str:
    """The table; a week with a failed recording has a mark at its foot."""
    weeks = _weeks(found.recordings)
    if not weeks:
        return "<p>No recording has a date.</p>"
    by_athlete: dict[str, list[Row]] = {name: [] for name in found.athletes}
    for row in found.recordings:
        by_athlete[row["athlete"]].append(row)
    changes = Counter(one.athlete for one in found.changes)
    rows = [_row(name, by_athlete[name], weeks, changes[name]) for name in found.athletes]
    swatches = [(f'<rect class="heat-{k}" width="14" height="10"/>', _level(k)) for k in range(MOST + 1)]
    swatches.append(('<rect class="heat-failed" y="6" width="14" height="4"/>', "a recording failed"))
    heads = [
        Column("Athlete"),
        Column("Weeks", f"{_day(weeks[0])} to {_day(weeks[-1])}"),
        Column("Sessions", meaning="Recordings with and without a result"),
        Column("Strokes"),
        Column("Changes", meaning="Changes that are listed below"),
    ]
    caption = (
        "One cell is a week, stronger with more sessions. Hover a cell for its numbers. A heading sorts."
    )
    return legend(swatches, BAR_SWATCH) + table("heat", caption, heads, rows, style="sortable heat")


def duration(seconds: float) -> str:
    """Hours, or minutes of less than two hours."""
    return f"{seconds / 3600.0:,.0f} h" if seconds >= 7200.0 else f"{seconds / 60.0:.0f} min"


def _row(name: str, rows: Sequence[Row], weeks: Sequence[str], changes: int) -> list[str]:
    strokes = sum(row["strokes"] for row in rows)
    return [
        escape(name),
        _cells(name, rows, weeks),
        value_cell(len(rows), f"{len(rows):,}"),
        value_cell(strokes, f"{strokes:,}"),
        value_cell(changes, str(changes) if changes else ""),
    ]


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
            f'<rect class="heat-{min(count[week], MOST)}" x="{k}" width="1" height="10">{words}</rect>'
        )
        if failed[week]:
            parts.append(f'<rect class="heat-failed" x="{k}" y="6" width="1" height="4"/>')
    active = plural(sum(1 for week in weeks if count[week]), "week")
    return (
        f'<svg class="weeks" viewBox="0 0 {len(weeks)} 10" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(name)}: rowed in {active} of {len(weeks)}">'
        f'<rect class="heat-0" width="{len(weeks)}" height="10"/>{"".join(parts)}</svg>'
    )


def _weeks(rows: Sequence[Row]) -> list[str]:
    """All Mondays from the first week to the last."""
    known = [row["week"] for row in rows if row["week"]]
    if not known:
        return []
    first, last = (datetime.date.fromisoformat(end) for end in (min(known), max(known)))
    count = (last - first).days // 7 + 1
    return [str(first + datetime.timedelta(weeks=k)) for k in range(count)]


def _day(text: str) -> str:
    return datetime.date.fromisoformat(text).strftime("%b %Y")


def _level(k: int) -> str:
    return "none" if k == 0 else f"{k} a week" if k < MOST else f"{MOST} or more"
