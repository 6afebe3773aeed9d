"""The sections of docs/validation.md: Oarlock and the best of the other software on each public recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from validation import dfjimu, diodem, openaxes, others, page
from validation.__main__ import SETS, run

from .record import Record, made_text, stamped
from .sections import table

PAGE = "docs/validation.md"
FACTS = ("note", "ours", "online")
"""What a row has beside its figures."""

SCORED = (
    ("dfjimu", f"Relative orientation, RMSE after 10 s, {dfjimu.OWN}"),
    ("diodem_arm", f"Rigid units, RMSE after 5 s, {diodem.PLAIN}"),
    ("diodem_arm", f"Foam units, RMSE after 5 s, {diodem.PLAIN}"),
    ("openaxes_ur5", f"Relative orientation, median after 5 s, {openaxes.PLAIN}"),
    ("openaxes_ur5", f"Orientations only, median after 5 s, {openaxes.PLAIN}"),
    ("broad", "Inclination, RMSE over the movement"),
    ("broad", "Heading, RMSE over the movement"),
    ("qmt_full_body", None),
    ("singular", "Upper arm in the world, RMSE after 2 s"),
)
"""The set and the title of each table that the page shows; None is the set's first."""

Rows = Mapping[str, Mapping[str, Any]]


def measured(names: Sequence[str] = (), earlier: Record | None = None) -> Iterator[Record]:
    """The record after each set that was run: a run that is stopped keeps what it has, and other sets keep theirs."""
    sets = dict(earlier["sets"]) if earlier else {}
    for name in names or SETS:
        (result,) = run([name])
        sets[result.name] = stamped(page.document([result], {})["sets"][result.name])
        yield {"versions": others.versions(), "sets": sets}


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of the page: a table for each set, with the date and commit of its figures."""
    versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    parts = [f"Beside {versions}. `make pages PAGES=validation` measures all anew, `SETS=broad` one set."]
    for name, title in SCORED:
        if name in record["sets"]:
            parts += _set(record["sets"][name], title)
    return {PAGE: {"figures": "\n\n".join(parts)}}


def _set(one: Mapping[str, Any], title: str | None) -> list[str]:
    if one["absent"]:
        return [f"**{one['title']}**: not run, {one['absent']}."]
    found = next(t for t in one["tables"] if title in (None, t["title"]))
    unit = f", {found['unit']}" if found["unit"] else ""
    return [f"**{one['title']}: {found['title']}{unit}.** {made_text(one)}.", _compared(found["rows"])]


def _compared(rows: Rows) -> str:
    """All lines of Oarlock, then the best live and the best offline line of the other software."""
    names = list(rows)
    columns = [c for c in rows[names[0]] if c not in FACTS]
    ours = [name for name in names if rows[name]["ours"]]
    rest = [best for live in (True, False) if (best := best_other(rows, columns, live))]
    lines = [[_called(name, rows[name]), *(_cell(rows[name][c]) for c in columns)] for name in [*ours, *rest]]
    return table(["", *columns], lines)


def best_other(rows: Rows, columns: Sequence[str], live: bool) -> str | None:
    """The other software with the smallest mean of the columns that all lines have; None if none ran."""
    shared = [c for c in columns if all(row[c] is not None for row in rows.values() if row["ours"])]
    means = {
        name: sum(row[c] for c in shared) / len(shared)
        for name, row in rows.items()
        if not row["ours"] and row["online"] == live and shared and all(row[c] is not None for c in shared)
    }
    return min(means, key=lambda name: means[name]) if means else None


def _called(name: str, row: Mapping[str, Any]) -> str:
    if row["ours"]:
        return name
    return f"{name} (best of the others, {'live' if row['online'] else 'offline'})"


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)
