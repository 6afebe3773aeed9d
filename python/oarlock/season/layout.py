"""Names inside a season, and the versions of what is stored there.

- `season.toml`: name, id, retention, the setup that `run` uses
- `athletes/PSEUDONYM.toml`: attributes and consent; never a name
- `recordings/ID/`: a recording's folder or a device's export, named by its contents; `entry.toml` is written last
- `results/ID.RUN/`: what one run found in one recording; `run.toml` is written last
- `setups/SETUP/`: the model, calibration and settings of runs, named by their contents
- `tables/`: compacted tables; `current.toml` says which files count
- `erased/HASH.toml`: tombstones: that the athlete of this hash was erased
- `exports/PSEUDONYM/`: what `export` wrote
- `logs/`: times, hosts and durations of runs: nothing that results depend on
"""

from __future__ import annotations

import hashlib
import json
from typing import Final

SEASON_FILE: Final = "season.toml"
SEASON_FORMAT: Final = 1
ATHLETES: Final = "athletes"
RECORDINGS: Final = "recordings"
RESULTS: Final = "results"
SETUPS: Final = "setups"
TABLES: Final = "tables"
ERASED: Final = "erased"
EXPORTS: Final = "exports"
LOGS: Final = "logs"

ENTRY_FILE: Final = "entry.toml"
"""Commit record of a recording."""
RUN_FILE: Final = "run.toml"
"""Commit record of a result."""
CURRENT_FILE: Final = "tables/current.toml"
STROKES_FILE: Final = "strokes.parquet"

ENTRY_FORMAT: Final = 1
RUN_FORMAT: Final = 1

_DIGITS = 20
"""Hexadecimal digits of a name made of contents: among a billion, two are alike with a chance of 1 in 2 million."""


def named_by(*parts: bytes) -> str:
    """A name made of contents."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()[:_DIGITS]


def named_by_document(document: object) -> str:
    """A name made of a document of texts, numbers, lists and tables, whatever the order of its keys."""
    return named_by(json.dumps(document, sort_keys=True, ensure_ascii=True, allow_nan=False).encode())


def recording_folder(recording: str) -> str:
    """The folder of a recording."""
    return f"{RECORDINGS}/{recording}"


def result_folder(recording: str, run: str) -> str:
    """The folder of a result."""
    return f"{RESULTS}/{recording}.{run}"
