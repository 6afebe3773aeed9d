"""Small pieces of HTML that notebooks show for an object (`_repr_html_`). Colours are those of the notebook."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

_CELL = "padding:.15em .8em .15em 0;border:0"
_UNBROKEN = 24
"""Cells up to this length stay on one line."""


def card(title: str, subtitle: str, *parts: str) -> str:
    """An object: a bold title, what it is, then its parts, which are HTML."""
    head = f"<b>{escape(title)}</b> <span style='opacity:.7'>{escape(subtitle)}</span>"
    return f"<div style='font-size:90%;line-height:1.5'>{head}{''.join(parts)}</div>"


def html_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; columns of numbers are aligned right, None and NaN are a dash."""
    lines = [[_text(cell) for cell in row] for row in rows]
    right = [all(_is_number(line[k]) for line in lines) for k in range(len(header))]
    body = "".join(_row("td", line, right) for line in lines)
    head = f"<thead style='opacity:.7'>{_row('th', header, right)}</thead>"
    return f"<table style='border:0;border-collapse:collapse'>{head}<tbody>{body}</tbody></table>"


def folded(summary: str, inside: str, is_open: bool = False) -> str:
    """A part that one click unfolds; nothing if it is empty."""
    if not inside:
        return ""
    return f"<details{' open' if is_open else ''}><summary>{escape(summary)}</summary>{inside}</details>"


def html_list(sentences: Iterable[str]) -> str:
    """Sentences as a list; nothing without a sentence."""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<ul style='margin:.2em 0;padding-left:1.2em'>{items}</ul>" if items else ""


def _row(kind: str, cells: Sequence[str], right: Sequence[bool]) -> str:
    return "<tr style='background:none'>{}</tr>".format(
        "".join(
            f"<{kind} style='{_CELL};text-align:{'right' if is_right else 'left'}{_wrap(cell)}'>{escape(cell)}</{kind}>"
            for cell, is_right in zip(cells, right, strict=True)
        )
    )


def _wrap(cell: str) -> str:
    return ";white-space:nowrap" if len(cell) <= _UNBROKEN else ""


def _text(cell: object) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    return f"{cell:.3g}" if isinstance(cell, float) else str(cell)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "–"
    return True
