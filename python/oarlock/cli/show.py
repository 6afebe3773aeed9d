"""Prints the result of a verb for people: the same data as `--json`, in the unit of the reader, with tables.

Names become labels and their unit goes beside the value: `duration_s` is `duration  12.4 s`; radians are shown in
degrees. What is empty is left out. `written` and `next` come last: files, and commands to go on with.
"""

from __future__ import annotations

import dataclasses
import datetime
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from oarlock.cli.terminal import WIDTH, heading, pairs, say, steps, table

MOST_ROWS: Final = 60
MOST_CELL: Final = 40
"""Width at which a text of a table is wrapped, characters."""
UNITS: Final = {
    "rad_s": ("deg/s", math.degrees(1.0)),
    "rad": ("deg", math.degrees(1.0)),
    "m_s2": ("m/s2", 1.0),
    "m_s": ("m/s", 1.0),
    "per_min": ("/min", 1.0),
    "deg": ("deg", 1.0),
    "hz": ("Hz", 1.0),
    "kg": ("kg", 1.0),
    "mm": ("mm", 1.0),
    "ms": ("ms", 1.0),
    "cm": ("cm", 1.0),
    "ut": ("uT", 1.0),
    "ppm": ("ppm", 1.0),
    "spm": ("/min", 1.0),
    "percent": ("%", 1.0),
    "dbm": ("dBm", 1.0),
    "m": ("m", 1.0),
    "s": ("s", 1.0),
    "w": ("W", 1.0),
    "n": ("N", 1.0),
}
"""End of a name -> unit for people, and what a value is multiplied by."""
HEADS: Final = {"rmse": "RMSE", "nees": "NEES", "nis": "NIS", "utc": "UTC", "std": "std"}


def show_document(result: Any) -> None:
    """Print a result: a mapping or dataclass of numbers, texts, mappings and rows, or rows alone.

    Numbers and texts are lines of `name  value`, rows of equal keys a table, a list of texts lines with a dash.
    """
    if isinstance(result, Sequence) and not isinstance(result, str):
        _show_rows(result)
        return
    document = dict(fields_of(result))
    written, then = document.pop("written", None), document.pop("next", ())
    _show_fields(document)
    if written:
        files = [written] if isinstance(written, str | Path) else list(written)
        say(f"Wrote {', '.join(str(file) for file in files)}")
    if then:
        steps(*then)


def fields_of(value: Any) -> Mapping[str, Any]:
    """A mapping, or the fields of a dataclass, by name."""
    if hasattr(value, "to_dict"):
        return dict(value.to_dict())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    return dict(value)


def unit_of(name: str) -> tuple[str, str, float]:
    """Label, unit and factor of a name: `("range", "deg", 57.3)` of `range_rad`."""
    for end, (unit, factor) in UNITS.items():
        if name.endswith(f"_{end}"):
            return label(name.removesuffix(f"_{end}")), unit, factor
    return label(name), "", 1.0


def label(name: str) -> str:
    """Words of a name."""
    return " ".join(HEADS.get(word, word) for word in str(name).split("_"))


def value_text(value: Any, factor: float = 1.0) -> str:
    """A value for people: numbers with three digits, times to the minute, nothing for none."""
    if value is None or value == "":
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number_text(value * factor)
    if isinstance(value, int):
        return f"{value:,}" if factor == 1.0 else number_text(value * factor)
    if isinstance(value, datetime.datetime):
        return f"{value:%Y-%m-%d %H:%M}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {value_text(item, factor)}" for name, item in value.items())
    if hasattr(value, "tolist"):  # of numpy, which help does not import
        return value_text(value.tolist(), factor)
    if isinstance(value, list | tuple):
        more = [f"and {len(value) - MOST_ROWS} more"] if len(value) > MOST_ROWS else []
        return ", ".join([*(value_text(item, factor) for item in value[:MOST_ROWS]), *more])
    return str(value)


def number_text(value: float) -> str:
    """A number with about three significant digits, without exponent unless it is tiny or huge; "-" without one."""
    if not math.isfinite(value):
        return "-"
    if not value:
        return "0"
    return f"{value:z.{_decimals(value)}f}" if 1e-4 <= abs(value) < 1e7 else f"{value:.3g}"


def _decimals(value: float) -> int:
    size = abs(value)
    return 0 if size >= 1000 else 1 if size >= 10 else min(2 - math.floor(math.log10(size)), 5)


def column_texts(values: Sequence[Any], factor: float = 1.0) -> list[str]:
    """Values of one quantity for people: finite numbers have as many decimals as the largest needs."""
    numbers = [value * factor for value in values if _is_number([value]) and math.isfinite(value)]
    largest = max(map(abs, numbers), default=0.0)
    if all(isinstance(value, int) for value in values if value is not None) or not 1e-3 <= largest < 1e7:
        return [value_text(value, factor) for value in values]
    digits = _decimals(largest)
    return [
        f"{value * factor:z.{digits}f}"
        if _is_number([value]) and math.isfinite(value)
        else value_text(value, factor)
        for value in values
    ]


def _is_number(values: Sequence[Any]) -> bool:
    """Whether a number is among them."""
    return any(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _is_rows(value: Any) -> bool:
    """Whether it is a table: a list, or a mapping, of mappings or dataclasses."""
    items = list(value.values() if isinstance(value, Mapping) else value)
    return bool(items) and all(isinstance(item, Mapping) or dataclasses.is_dataclass(item) for item in items)


def _is_block(value: Any) -> bool:
    """Whether it stands under a heading of its own: a mapping, rows, sentences or files."""
    if isinstance(value, list | tuple):
        return _is_rows(value) or any(isinstance(item, str) and {" ", "/"} & {*item} for item in value)
    return isinstance(value, Mapping) or dataclasses.is_dataclass(value)


def _show_fields(document: Mapping[str, Any], title: str = "") -> None:
    lines: list[tuple[str, object]] = []
    blocks: list[tuple[str, Any]] = []
    for name, value in document.items():
        if _is_block(value):
            blocks.append((name, value))
        else:
            text, unit, factor = unit_of(name)
            shown = value_text(value, factor)
            lines.append((text, f"{shown} {unit}".strip() if shown else ""))
    if any(shown for _, shown in lines):
        if title:
            heading(title)
        pairs(lines[:MOST_ROWS])
        if len(lines) > MOST_ROWS:
            say(f"and {len(lines) - MOST_ROWS} more; --json has all", indent=2)
    for name, value in blocks:
        _show_block(label(name), value)


def _show_block(title: str, value: Any) -> None:
    """A part with a heading of its own; nothing if it is empty."""
    title = title[:1].upper() + title[1:]
    if not dataclasses.is_dataclass(value) and not value:
        return
    if isinstance(value, list | tuple) and not _is_rows(value):
        heading(title)
        for text in value[:MOST_ROWS]:
            say(f"- {text}", indent=2)
        if len(value) > MOST_ROWS:
            say(f"and {len(value) - MOST_ROWS} more; --json has all", indent=2)
    elif not dataclasses.is_dataclass(value) and _is_rows(value):
        heading(title)
        if isinstance(value, Mapping):
            value = [{"name": name, **fields_of(item)} for name, item in value.items()]
        _show_rows(value)
    else:
        _show_fields(fields_of(value), title)


def _show_rows(rows: Sequence[Any]) -> None:
    """A table; a column has the unit of its name in its head, numbers are aligned right."""
    if not rows:
        say("None.", indent=2)
        return
    mappings = [fields_of(row) for row in rows[:MOST_ROWS]]
    names = list(dict.fromkeys(name for row in mappings for name in row))
    columns = {name: [row.get(name) for row in mappings] for name in names}
    texts = {name: column_texts(values, unit_of(name)[2]) for name, values in columns.items()}
    # what is long comes last: there a text is wrapped, and what does not fit is left out
    names.sort(key=lambda name: max(map(len, texts[name])) > MOST_CELL)
    heads: list[str] = []
    hidden: list[str] = []
    width = 0
    for name in names:
        head = " ".join(unit_of(name)[:2]).strip()
        cells = min(MOST_CELL, max(map(len, texts[name])))
        width += max(cells, *map(len, head.split())) + 2
        if width > WIDTH and heads:
            hidden.append(name)
        else:
            heads.append(f"{'>' * _is_number(columns[name])}{head}")
    shown = [texts[name] for name in names if name not in hidden]
    table(heads, list(zip(*shown, strict=True)))
    if hidden:
        say(f"--json also has {', '.join(map(label, hidden))}", style="dim", indent=2)
    if len(rows) > MOST_ROWS:
        say(f"and {len(rows) - MOST_ROWS} more; --json has all", indent=2)
