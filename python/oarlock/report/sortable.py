"""A table that can be sorted by click or key, for field sections; without its script it is a plain table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from importlib.resources import files

from oarlock.report.markup import Column, table


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
