"""Answers to questions to a season, as tables for people and as files. For `oarlock season`."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from numbers import Number
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.cli.show import MOST_CELL, MOST_ROWS, label, show_document, value_text
from oarlock.cli.terminal import WIDTH, pairs, say, table

if TYPE_CHECKING:
    import pyarrow as pa

_HIDDEN = (
    *("se", "se_s", "at_s", "comparable", "with_rate", "rate_spread", "first_month", "last_month", "run"),
    *("mean_before", "mean_after", "first", "last", "rig", "high", "high_s"),
)
"""Columns of ready questions that only files and JSON have; `low` has the band."""
_SECONDS = ("late_s", "low_s", "sd_s")
"""Columns of crew timing, shown in ms."""
_BANDS = {"low": "high", "low_s": "high_s"}


def show_answer(answer: Mapping[str, Any]) -> None:
    """Print rows of SQL as they are; those of a question in the unit of its metric, with bands in one column."""
    from oarlock.season.questions import is_scaled, shown_metric

    rows = answer.get("rows", answer.get("months"))
    if rows is None:
        return show_document(answer)
    names = list(rows[0]) if rows else []
    scales: dict[str, float] = {}
    if metric := answer.get("metric"):
        shown = shown_metric(metric)
        title = f"{shown.label}, {shown.unit}" if shown.unit else shown.label
        say(f"{title}: {answer['athlete']}" if "athlete" in answer else title, style="bold")
        scales = {name: shown.scale for name in names if is_scaled(name)}
    is_ready = "metric" in answer
    hidden = {"run"} if is_ready else set()
    if metric or (is_ready and "late_s" in names):
        scales |= dict.fromkeys(_SECONDS, 1e3)
        rows = [row | {low: _band(row, low, scales[low]) for low in _BANDS if low in row} for row in rows]
        hidden = {*_HIDDEN, *(("boat", "changed") if "before" in names else ())}
        hidden |= {"athlete"} if "months" in answer else set()
    heads, columns, left_out, width = [], [], list[str](), 0
    for name in (name for name in names if name not in hidden):
        cells = [_cell(row[name], scales.get(name, 1.0)) for row in rows[:MOST_ROWS]]
        head = _head(name) if is_ready else name
        width += min(MOST_CELL, max(map(len, (head, *cells)))) + 2
        if width > WIDTH:
            left_out.append(name)
        else:
            heads.append(f"{'>' * any(_is_number(row[name]) for row in rows)}{head}")
            columns.append(cells)
    table(heads, list(zip(*columns, strict=True)))
    if left_out:
        say(f"--json also has {', '.join(left_out)}", style="dim", indent=2)
    if not rows:
        say("No rows.", indent=2)
    if len(rows) > MOST_ROWS:
        say(f"{MOST_ROWS} of {len(rows)} rows; --csv or --parquet writes all", indent=2)
    if (change := answer.get("change")) is not None:
        values = {name: value for name, value in vars(change).items() if name != "high"}
        values["low"] = _band(vars(change), "low", shown.scale)
        pairs([(_head(name), _cell(value, shown.scale)) for name, value in values.items()])
    for note in answer.get("notes", ()):
        say(f"- {note}")


def _head(name: str) -> str:
    if name in _BANDS:
        return "95 % band"
    return f"{name.removesuffix('_s')}, ms" if name in _SECONDS else label(name)


def _is_number(value: object) -> bool:
    return isinstance(value, Number) and not isinstance(value, bool)


def _band(row: Mapping[str, Any], low: str, scale: float) -> str | None:
    """Both ends of a band."""
    ends = row[low], row[_BANDS[low]]
    return None if None in ends else " to ".join(_cell(end, scale) for end in ends)


def _cell(value: object, scale: float) -> str:
    """As others, but numbers with three significant digits from 1 on, and two behind the point below."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "-"
    if not isinstance(value, float):
        return str(value) if _is_number(value) else value_text(value)
    number = value * scale
    digits = 3 - len(str(int(abs(number))))
    return f"{number:.2g}" if abs(number) < 0.1 else f"{number:.{max(0, digits)}f}"


def write_table(rows: pa.Table, file: Path, kind: str) -> None:
    """Write all rows as a file; in CSV a column of lists or maps becomes text."""
    import pyarrow as pa
    from pyarrow import parquet

    from oarlock.storage.arrow_csv import write_arrow_csv
    from oarlock.storage.write_file import write_file

    out = io.BytesIO()
    if kind == "parquet":
        parquet.write_table(rows, out)
    else:
        for k, column in enumerate(rows.columns):
            if pa.types.is_nested(column.type):
                texts = [None if cell is None else str(cell) for cell in column.to_pylist()]
                rows = rows.set_column(k, rows.column_names[k], pa.array(texts, pa.string()))
        write_arrow_csv(rows, out)
    write_file(file, out.getvalue())
