"""Runs the tutorials as they are written, and measures the time of each command."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from oarlock_lab.pages.record import ROOT, Record, made_text

from .steps import Reader

TUTORIALS = ("first-arm", "first-piece", "own-body")


def run(name: str, programs: Path, folder: Path) -> list[tuple[str, float]]:
    """Run a tutorial with the `oarlock` and `python` of a folder of programs, in an empty folder.

    Returns:
        Each command with its seconds.

    Raises:
        RuntimeError: a command failed.
    """
    return Reader(folder, programs).follow((ROOT / f"docs/tutorials/{name}.md").read_text(encoding="utf-8"))


def measured(python: Path = Path(sys.executable)) -> dict[str, Any]:
    """Run all tutorials with a Python in which Oarlock is installed.

    Raises:
        RuntimeError: a command failed.
    """
    figures: dict[str, Any] = {}
    for name in TUTORIALS:
        with TemporaryDirectory() as folder:
            figures[name] = [
                {"command": text, "s": round(s, 1)} for text, s in run(name, python.parent, Path(folder))
            ]
    return {"machine": machine(), "tutorials": figures}


def machine() -> str:
    """The machine in words."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    busy = f", where {os.getloadavg()[0]:.0f} programs wanted a core" if hasattr(os, "getloadavg") else ""
    return f"{cores} cores ({platform.machine()}, {platform.system()}){busy}"


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The time that each tutorial's commands take."""
    made = f"{made_text(record)}, installed from a wheel, on {record['machine']}; "
    made += "`make pages PAGES=tutorials` measures it anew."
    sections_by_name = {}
    for name, commands in record["tutorials"].items():
        total_s, longest_s = (f([command["s"] for command in commands]) for f in (sum, max))
        sentence = f"All commands take {total_s:.1f} s, the longest {longest_s:.1f} s."
        sections_by_name[f"docs/tutorials/{name}.md"] = {"times": f"{sentence}\n\n{made}"}
    return sections_by_name
