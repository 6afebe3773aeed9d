"""Lists and rows that verbs of `oarlock season` print, and rows as files."""

from __future__ import annotations

import datetime
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from oarlock.cli.terminal import heading, say, table
from oarlock.storage.regular_file import read_bytes

if TYPE_CHECKING:
    import pyarrow as pa

MOST_SHOWN = 20
_MOST_ROWS = 60
_HIDDEN = (
    *("se", "se_s", "at_s", "comparable", "with_rate", "rate_spread", "first_month", "last_month", "run"),
    *("mean_before", "mean_after", "first", "last", "rig"),
)
"""Columns of ready questions that only files and JSON have."""
_SECONDS = ("late_s", "low_s", "high_s", "sd_s")
"""Columns of crew timing, shown in ms."""
_BANDS = {"low": "high", "low_s": "high_s"}


def show_rows(rows: pa.Table) -> None:
    """Print the rows of a statement as they are."""
    names = rows.column_names
    numbers = {field.name for field in rows.schema if _is_number(field.type)}
    cells = [tuple(_cell(row[name], 1.0) for name in names) for row in rows.slice(0, _MOST_ROWS).to_pylist()]
    table([f">{name}" if name in numbers else name for name in names], cells)
    _say_more(rows)


def show_answer(rows: pa.Table, metric: str | None) -> None:
    """Print the rows of a ready question, of a metric in the unit in which it is shown, with bands in one column."""
    from oarlock.season.questions import is_scaled, shown_metric

    shown = shown_metric(metric) if metric is not None else None
    if shown is not None:
        say(f"{shown.label}, {shown.unit}" if shown.unit else shown.label, style="bold")
    hidden = (*_HIDDEN, *_BANDS.values()) if shown is not None or "late_s" in rows.column_names else ("run",)
    if "before" in rows.column_names:
        hidden = (*hidden, "boat", "changed")  # what stays is as wide as the page
    names = [name for name in rows.column_names if name not in hidden]
    scales = dict.fromkeys(rows.column_names, 1.0) | dict.fromkeys(_SECONDS, 1e3)
    if shown is not None:
        scales |= {name: shown.scale for name in rows.column_names if is_scaled(name)}

    def cell(row: dict[str, object], name: str) -> str:
        if name in _BANDS:
            return shown_band(row[name], row[_BANDS[name]], scales[name])
        return _cell(row[name], scales[name])

    numbers = {field.name for field in rows.schema if _is_number(field.type)} - set(_BANDS)
    heads = [f">{_head(name)}" if name in numbers else _head(name) for name in names]
    shown_rows = rows.slice(0, _MOST_ROWS).to_pylist()
    table(heads, [tuple(cell(row, name) for name in names) for row in shown_rows])
    _say_more(rows)


def _head(name: str) -> str:
    if name in _BANDS:
        return "95 % band"
    return f"{name.removesuffix('_s')}, ms" if name in _SECONDS else name.replace("_", " ")


def _say_more(rows: pa.Table) -> None:
    if not rows.num_rows:
        say("No rows.", indent=2)
    if rows.num_rows > _MOST_ROWS:
        say(f"{_MOST_ROWS} of {rows.num_rows} rows; --csv or --parquet writes all", indent=2)


def show_list(title: str, lines: Sequence[str], rest: str = "") -> None:
    """Print the first `MOST_SHOWN` lines under a heading, how many there are more, and where the rest is."""
    if not lines:
        return
    heading(title)
    for line in lines[:MOST_SHOWN]:
        say(f"- {line}", indent=2)
    say_more(len(lines), rest)


def say_more(count: int, rest: str = "") -> None:
    """Print how many of `count` rows are not shown, if any."""
    if count > MOST_SHOWN:
        say(f"and {count - MOST_SHOWN} more" + (f": `{rest}`" if rest else ""), indent=2)


def shown_value(value: float | None, scale: float) -> str:
    """A number with three significant digits from 1 on, and two behind the point below; "-" without one."""
    if value is None or not math.isfinite(value):
        return "-"
    shown = value * scale
    whole = len(str(int(abs(shown))))
    return f"{shown:.2g}" if abs(shown) < 0.1 else f"{shown:.{max(0, 3 - whole)}f}"


def shown_band(low: Any, high: Any, scale: float) -> str:
    """A band in words."""
    if low is None or high is None:
        return "-"
    return f"{shown_value(low, scale)} to {shown_value(high, scale)}"


def write_table(rows: pa.Table, file: Path, kind: Literal["csv", "parquet"]) -> None:
    """Write all rows as a file; in CSV a column of lists or maps becomes text."""
    import io

    import pyarrow as pa
    from pyarrow import parquet

    from oarlock.storage.arrow_csv import write_arrow_csv
    from oarlock.storage.folder_writer import scratch_folder
    from oarlock.storage.write_file import write_file

    if kind == "parquet":
        out = io.BytesIO()
        parquet.write_table(rows, out)
        return write_file(file, out.getvalue())
    columns = [
        pa.array([None if one is None else str(one) for one in column.to_pylist()], pa.string())
        if pa.types.is_nested(column.type)
        else column
        for column in rows.columns
    ]
    with scratch_folder() as scratch:
        write_arrow_csv(pa.table(columns, rows.column_names), scratch / "rows.csv")
        write_file(file, read_bytes(scratch / "rows.csv"))


def _cell(value: object, scale: float) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return shown_value(value, scale)
    if isinstance(value, datetime.datetime):
        return f"{value:%Y-%m-%d %H:%M}"
    return str(value)


def _is_number(kind: pa.DataType) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind))
