"""Markup of the pages from the Jinja templates beside this file: figures, legends, tables, lists.

Jinja escapes every value. Where a template says `safe`, the value is markup already: a drawing, a table, a cell.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from oarlock.report.text import breakable

if TYPE_CHECKING:
    from jinja2 import Environment

SWATCH, BAR_SWATCH = (28, 12), (14, 10)
"""Width and height of a legend's pictures: of lines and bands, of bars."""


class Column(NamedTuple):
    """A head, its unit below it, and its meaning (shown on hovering, read aloud)."""

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
    """The template of this name with its values, without line ends at its end."""
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
    """A drawing under its name; `drawing`, `fact` and what stands `below` are markup."""
    return rendered(
        "figure", name=name, drawing=drawing, unit=unit, fact=fact, key=key, style=style, below=below
    )


def legend(entries: Iterable[tuple[str, str]], size: tuple[int, int] = SWATCH, style: str = "") -> str:
    """What lines and colours mean: the inside of a small drawing, markup, and a name for each."""
    return rendered("legend", entries=list(entries), width=size[0], height=size[1], style=style)


def bar_legend(entries: Iterable[tuple[str, str]]) -> str:
    """What the colours of bars mean: the class of a bar, and a name for each."""
    swatches = ((f'<rect class="{style}" width="14" height="10"/>', name) for style, name in entries)
    return legend(swatches, BAR_SWATCH)


def notes_list(notes: Iterable[str]) -> str:
    """Sentences below each other."""
    return rendered("notes", notes=list(notes))


def grid(drawings: Iterable[str], style: str = "") -> str:
    """Drawings, markup each, side by side."""
    return f'<div class="grid-figures{" " + style if style else ""}">{"".join(drawings)}</div>'


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
    """A table that scrolls sideways by itself where the page is narrow.

    Args:
        key: of its ids.
        caption: above it.
        heads: one for each column.
        rows: cells that are markup already; the first of a row is its header.
        styles: classes of rows, by their number.
        foot: rows that stay below.
        style: class of the table.
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
