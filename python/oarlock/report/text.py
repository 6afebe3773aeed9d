"""Formats numbers and lists as text for all pages."""

from __future__ import annotations

import datetime
import math
from html import escape

MINUS = "\N{MINUS SIGN}"
DASH = "\N{EN DASH}"
_MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)
"""Not those of the system's language: pages are in English."""


def number(value: float, digits: int = 3) -> str:
    """``digits`` significant digits, without exponent between 1e-4 and 1e6; a dash for NaN."""
    if not math.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if power < -4 or power > 5:
        return f"{value:.{digits - 1}e}".replace("-", MINUS)
    return f"{value:,.{max(digits - 1 - power, 0)}f}".replace("-", MINUS)


def decimals(value: float) -> int:
    """Number of decimals for three significant digits of a value; at most 6."""
    if not math.isfinite(value) or value == 0:
        return 0
    return min(max(2 - math.floor(math.log10(abs(value))), 0), 6)


def fixed(value: float, places: int) -> str:
    """A fixed number of decimals; a dash for NaN."""
    if not math.isfinite(value):
        return DASH
    shown = round(value, places) + 0.0  # no minus before zero
    return f"{shown:,.{places}f}".replace("-", MINUS)


def percent(share: float) -> str:
    """A share of 1 in percent, one decimal."""
    return f"{fixed(100 * share, 1)} %" if math.isfinite(share) else DASH


def capital(text: str) -> str:
    """With a large first letter."""
    return text[:1].upper() + text[1:]


def day_text(day: str) -> str:
    """A date as people write it: `20 May 2026` of `2026-05-20`; another text as it is."""
    try:
        found = datetime.date.fromisoformat(day)
    except ValueError:
        return day
    return f"{found.day} {_MONTHS[found.month - 1]} {found.year}"


def plural(count: int, noun: str) -> str:
    """``1 joint``, ``1,200 joints``."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def listing(names: list[str]) -> str:
    """``a, b and c``; after six names, how many more."""
    if len(names) > 6:
        return f"{', '.join(names[:6])} and {len(names) - 6} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def breakable(name: str) -> str:
    """An escaped name that may break after an underscore or a dot."""
    return escape(name).replace("_", "_<wbr>").replace(".", ".<wbr>")
