"""HTML of the pages' parts from Jinja templates: figures, legends, tables, lists.

Jinja escapes every value. A template marks a value as `safe` if it is already markup: a drawing, a table, a cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

from oarlock.report.text import breakable

if TYPE_CHECKING:
    from jinja2 import Environment

SWATCH, BAR_SWATCH = (28, 12), (14, 10)
"""Width and height of a legend's pictures: of lines and bands, of bars."""


class Column(NamedTuple):
    """A column heading, its unit below it, and its meaning (shown on hovering, read by screen readers)."""

    name: str
    unit: str = ""
    meaning: str = ""


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    found = Environment(
        loader=PackageLoader("oarlock.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["breakable"] = lambda name: Markup(breakable(name))
    return found


def rendered(template: str, **values: object) -> str:
    """Render the template of this name, without line ends at the end."""
    return _environment().get_template(f"{template}.html.j2").render(values)


def figure(
    name: str,
    drawing: str,
    *,
    unit: str = "",
    fact: str = "",
    key: str = "",
    style: str = "",
    below: str = "",
) -> str:
    """A drawing with its title; `drawing`, `fact` and `below` are markup."""
    return rendered(
        "figure", name=name, drawing=drawing, unit=unit, fact=fact, key=key, style=style, below=below
    )


def legend(entries: Iterable[tuple[str, str]], size: tuple[int, int] = SWATCH, style: str = "") -> str:
    """A legend of lines and colours: the content of a small drawing (markup) and a name for each."""
    return rendered("legend", entries=list(entries), width=size[0], height=size[1], style=style)


def bar_legend(entries: Iterable[tuple[str, str]]) -> str:
    """A legend of bars: the class of a bar and a name for each."""
    swatches = ((f'<rect class="{style}" width="14" height="10"/>', name) for style, name in entries)
    return legend(swatches, BAR_SWATCH)


def notes_list(notes: Iterable[str]) -> str:
    """A list of sentences."""
    return rendered("notes", notes=list(notes))


def folded_help(text: str) -> str:
    """How to use what stands above, as text; folded."""
    return (
        f'<details class="help"><summary>How to use it</summary><p class="hint">{escape(text)}</p></details>'
    )


def grid(drawings: Iterable[str], style: str = "") -> str:
    """Drawings, markup each, side by side; "" without drawings."""
    drawn = "".join(drawings)
    return f'<div class="grid-figures{" " + style if style else ""}">{drawn}</div>' if drawn else ""


def table(
    key: str,
    caption: str,
    heads: Sequence[str | Column],
    rows: Sequence[Sequence[str]],
    styles: Mapping[int, str] | None = None,
    *,
    foot: Sequence[Sequence[str]] = (),
    style: str = "",
) -> str:
    """A table that scrolls horizontally on a narrow page.

    Args:
        key: of its ids.
        caption: above it.
        heads: one for each column.
        rows: cells that are markup already; the first of a row is its header.
        styles: classes of rows, by their number.
        foot: rows that stay at the end.
        style: classes of the table; a "stacked" one has its rows as blocks on a telephone.
    """
    return rendered(
        "table",
        key=key,
        caption=caption,
        heads=[Column(head) if isinstance(head, str) else head for head in heads],
        rows=rows,
        styles=styles or {},
        foot=foot,
        style=style,
    )


def sort_script() -> str:
    """The script that the page needs once for all its sortable tables."""
    return files(__package__).joinpath("sort.js").read_text(encoding="utf-8")


def value_cell(value: float, text: str) -> str:
    """The markup inside a cell that shows the text and is sorted by the number."""
    return f'<data value="{"nan" if math.isnan(value) else f"{value:.9g}"}">{escape(text)}</data>'


def sortable_table(
    key: str,
    caption: str,
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    foot: Sequence[Sequence[str]] = (),
    muted: Sequence[int] = (),
    style: str = "",
) -> str:
    """A table whose first column is a row header; cells are markup. `foot` stays at the end; `muted` rows are grey.

    `style`: further classes; a "stacked" table has its rows as blocks on a telephone.
    """
    return table(
        key,
        caption,
        columns,
        rows,
        dict.fromkeys(muted, "muted"),
        foot=foot,
        style=f"sortable {style}".strip(),
    )
