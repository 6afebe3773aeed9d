"""The table of docs/live.md: sessions of emulated devices by their real transports, against the offline track."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

from oarlock_lab.soak.real_time import measured as rows

from .record import Record, made_text
from .sections import table

COLUMNS = (
    "kind, transports",
    "Hz",
    "perfect clocks: largest difference, deg",
    "faults: error, deg",
    "over offline",
)


def measured() -> dict[str, Any]:
    """Runs every kind by every transport, twice: about a quarter of an hour."""
    device_rows = rows()
    return {"rows": device_rows, "load": os.getloadavg()[0], "nice": os.nice(0)}


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of docs/live.md."""
    busy = f"on two cores that {record['load']:.0f} programs wanted"
    busy += ", at a raised priority" if record["nice"] < 0 else ""
    made = f"{made_text(record)}, {busy}; `make pages PAGES=emulated` measures it anew."
    kinds = groupby(record["rows"], key=lambda row: (row["kind"], row["rate_hz"]))
    text = table(COLUMNS, [_line(kind, rate_hz, list(rows)) for (kind, rate_hz), rows in kinds])
    return {"docs/live.md": {"emulated": f"{text}\n\n{made}"}}


def _line(kind: str, rate_hz: float, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """All transports of a kind, in their order."""

    def figures(of: Callable[[Mapping[str, Any]], float]) -> str:
        return ", ".join(f"{of(row):.3f}" for row in rows)

    return [
        f"`{kind}`: {', '.join(row['transport'] for row in rows)}",
        f"{rate_hz:g}",
        figures(lambda row: row["perfect"]["difference_deg"]),
        figures(lambda row: row["faulty"]["live_deg"]),
        figures(lambda row: row["faulty"]["live_deg"] / row["faulty"]["offline_deg"]),
    ]
