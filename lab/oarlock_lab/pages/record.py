"""Records of measured figures in `docs/figures/`: what was measured, when, and with which commit of the engine."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import oarlock

ROOT = Path(__file__).parents[3]
FIGURES = Path("docs/figures")
ENGINE = ("crates", "python/oarlock", "Cargo.lock")
"""What determines the figures; a change of a page alone does not."""
DIGITS = 6

Record = dict[str, Any]


def stamped(figures: Mapping[str, Any]) -> Record:
    """The figures with the date, the version and the last commit of the engine and the package."""
    made = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "oarlock": oarlock.__version__,
        "commit": engine_commit(),
    }
    return {"made": made, **rounded(figures)}


def engine_commit(root: Path = ROOT) -> str:
    """Short hash of the last commit that changed the engine; marked if files differ from it."""
    commit = _git(root, "log", "-1", "--format=%h", "--", *ENGINE) or "unknown"
    return f"{commit} with changes" if _git(root, "status", "--porcelain", "--", *ENGINE) else commit


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()


def made_text(record: Mapping[str, Any]) -> str:
    """A sentence for the page: date, version and commit."""
    made = record["made"]
    return f"Measured on {made['date']} with Oarlock {made['oarlock']}, commit {made['commit']}"


def rounded(value: Any) -> Any:
    """Plain values for JSON: six significant digits, null for what is no number."""
    if isinstance(value, Mapping):
        return {str(key): rounded(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(entry) for entry in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


def save(name: str, record: Record, root: Path = ROOT) -> Path:
    """Write a record, and give its file."""
    file = root / FIGURES / f"{name}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(
        json.dumps(record, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    return file


def load(name: str, root: Path = ROOT) -> Record:
    """The record of this name."""
    record: Record = json.loads((root / FIGURES / f"{name}.json").read_text(encoding="utf-8"))
    return record
