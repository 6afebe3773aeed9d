"""The sections of docs/validation.md: Oarlock and the best of the other software on each public recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from oarlock_lab.validation import dfjimu, diodem, openaxes, others, page, people
from oarlock_lab.validation.__main__ import SETS, run

from .record import Record, made_text, stamped
from .sections import table

PAGE = "docs/validation.md"
FACTS = ("note", "ours", "online")
"""What a row has beside its figures."""
HELPED = "heading given"
"""In the name of an estimate that got the relative heading of its bodies from the reference."""

SCORED = (
    ("people", people.HARD_TITLE),
    ("people", people.IN_PLACE_TITLE),
    ("dfjimu", f"Relative orientation, RMSE after 10 s, {dfjimu.OWN}"),
    ("diodem_arm", f"Rigid units, RMSE after 5 s, {diodem.PLAIN}"),
    ("diodem_arm", f"Foam units, RMSE after 5 s, {diodem.PLAIN}"),
    ("openaxes_ur5", f"Relative orientation, median after 5 s, {openaxes.PLAIN}"),
    ("broad", "Inclination, RMSE over the movement"),
    ("broad", "Heading, RMSE over the movement"),
    ("qmt_full_body", None),
    ("singular", "Upper arm in the world, RMSE after 2 s"),
)
"""The set and the title of each table that the page shows; None is the set's first."""
COLUMNS_IN_RECORD_ONLY = (
    *("VQF + 0.3 deg", "worst as tracked", "e2/var"),
    *("circle-100", "circle-250", "triangle-150", "triangle-250"),
    *("slow rotation A", "fast translation A", "tapping A", "phone vibration A"),
)
"""The means contain them."""
ROWS_IN_RECORD_ONLY = ("calibration found", "inverse kinematics", "9D, smoothed", "hinges 6D, smoothed")
"""Words in the names of rows that say what others say."""

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
    for name in dict(SCORED):
        if name in record["sets"]:
            parts += _set(record["sets"][name], [title for key, title in SCORED if key == name])
    people_text = _people(record["sets"]["people"]) if "people" in record["sets"] else ""
    return {PAGE: {"figures": "\n\n".join(parts)}, "README.md": {"people": people_text}}


def _people(person: Mapping[str, Any]) -> str:
    """The table of README: medians on people, beside one filter for each unit."""
    if person["absent"]:
        return f"Not run, {person['absent']}."
    columns = ("tilt", "relative", "as tracked")
    groups = [(table["title"].split(":")[0].lower(), table["rows"]) for table in person["tables"]]
    heads = [f"{column}, {group}" for group, _ in groups for column in columns]
    names = list(groups[0][1])
    lines = [[name, *(_cell(rows[name][c]) for _, rows in groups for c in columns)] for name in names]
    return f"{table(['', *heads], lines)}\n\n{made_text(person)}."


def _set(figures: Mapping[str, Any], titles: Sequence[str | None]) -> list[str]:
    if figures["absent"]:
        return [f"**{figures['title']}**: not run, {figures['absent']}."]
    parts = [f"**{figures['title']}.** {made_text(figures)}."]
    for title in titles:
        table = next(t for t in figures["tables"] if title in (None, t["title"]))
        unit = f", {table['unit']}" if table["unit"] else ""
        rows = {
            name: row
            for name, row in table["rows"].items()
            if not any(words in name for words in ROWS_IN_RECORD_ONLY)
        }
        text = _whole(rows) if figures["title"] == people.TITLE else _compared(rows)
        parts += [f"{table['title']}{unit}:", text]
    return parts


def _whole(rows: Rows) -> str:
    columns = _columns(rows)
    return table(["", *columns], [[name, *(_cell(row[c]) for c in columns)] for name, row in rows.items()])


def _compared(rows: Rows) -> str:
    """All lines of Oarlock, then the best of the other software in each column, live and offline."""
    columns = _columns(rows)
    lines = [[name, *(_cell(row[c]) for c in columns)] for name, row in rows.items() if row["ours"]]
    for helped in (False, True):
        for live in (True, False):
            best = {column: best_other(rows, column, live, helped) for column in columns}
            if any(best.values()):
                lines.append(_line_of_best(rows, best, "live" if live else "offline"))
    return table(["", *columns], lines)


def _columns(rows: Rows) -> list[str]:
    return [c for c in next(iter(rows.values())) if c not in (*FACTS, *COLUMNS_IN_RECORD_ONLY)]


def _line_of_best(rows: Rows, best: Mapping[str, str | None], when: str) -> list[str]:
    """The best figure of each column, after the names of all that have one."""
    names = sorted({name for name in best.values() if name})
    cells = [_cell(rows[name][column]) if name else "–" for column, name in best.items()]
    return [f"best other, {when}: {' or '.join(names)}", *cells]


def best_other(rows: Rows, column: str, live: bool, helped: bool) -> str | None:
    """The other software with the smallest figure of a column; None if none has one."""
    figures = {
        name: row[column]
        for name, row in rows.items()
        if not row["ours"]
        and row["online"] == live
        and (HELPED in name) == helped
        and row[column] is not None
    }
    return min(figures, key=lambda name: figures[name]) if figures else None


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)
