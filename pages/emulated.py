"""The table of docs/live.md: sessions of emulated devices by their real transports, against the offline track."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from bench.live.real_time import measured as rows

from .record import Record, made_text
from .sections import table

COLUMNS = (
    "kind",
    "transport",
    "rate, Hz",
    "perfect clocks: largest difference, deg",
    "faults: error live, deg",
    "offline, deg",
    "ratio",
)


def measured() -> dict[str, Any]:
    """Runs every kind by every transport, twice: about a quarter of an hour."""
    found = rows()
    return {"rows": found, "load": os.getloadavg()[0], "nice": os.nice(0)}


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of docs/live.md."""
    busy = f"on two cores that {record['load']:.0f} programs wanted"
    busy += ", at a raised priority" if record["nice"] < 0 else ""
    made = f"{made_text(record)}, {busy}; `make pages PAGES=emulated` measures it anew."
    found = table(COLUMNS, [_line(row) for row in record["rows"]])
    return {"docs/live.md": {"emulated": f"{found}\n\n{made}"}}


def _line(row: Mapping[str, Any]) -> list[str]:
    perfect, faulty = row["perfect"], row["faulty"]
    ratio = faulty["live_deg"] / faulty["offline_deg"]
    return [
        f"`{row['kind']}`",
        f"`{row['transport']}`",
        f"{row['rate_hz']:g}",
        f"{perfect['difference_deg']:.3f}",
        f"{faulty['live_deg']:.3f}",
        f"{faulty['offline_deg']:.3f}",
        f"{ratio:.3f}",
    ]
