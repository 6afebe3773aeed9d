"""Runs the tutorials as they are written, and measures the time of each command.

A line of an `sh` block is a command; a block with `title="FILE"` is written to that file. `console` blocks install and
are not run.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pages.record import ROOT, Record, made_text
from pages.sections import table

TUTORIALS = ("first-arm", "first-piece", "own-body")
BLOCK = re.compile(r'^```(\w+)(?: title="([\w.-]+)")?\n(.*?)^```$', re.M | re.S)


@dataclass(frozen=True)
class Step:
    """A command of a tutorial, or a file that it asks the reader to write.

    Args:
        text: the command, or the file's contents.
        file: name of the file; empty for a command.
    """

    text: str
    file: str = ""


def steps(page: str) -> Iterator[Step]:
    """The commands and files of a page, in order."""
    for language, file, text in BLOCK.findall(page):
        if file:
            yield Step(text, file)
        elif language == "sh":
            yield from (Step(line) for line in text.splitlines() if line and not line.startswith("#"))


def run(name: str, programs: Path, folder: Path) -> list[tuple[str, float]]:
    """Run a tutorial with the `oarlock` and `python` of a folder of programs.

    Args:
        name: of the tutorial's page.
        programs: such as `bin` of a virtual environment.
        folder: an empty folder to work in.

    Returns:
        Each command with its seconds.

    Raises:
        RuntimeError: a command failed.
    """
    done = []
    for step in steps((ROOT / f"docs/tutorials/{name}.md").read_text(encoding="utf-8")):
        if step.file:
            (folder / step.file).write_text(step.text, encoding="utf-8")
            continue
        begin = time.perf_counter()
        result = subprocess.run(
            step.text, shell=True, cwd=folder, env=_environment(programs), capture_output=True, text=True
        )
        if result.returncode:
            raise RuntimeError(f"{name}: {step.text}\n{result.stdout[-2000:]}\n{result.stderr[-2000:]}")
        done.append((step.text, time.perf_counter() - begin))
    return done


def _environment(programs: Path) -> dict[str, str]:
    """Without what would let the checkout's package be found before the one that is installed there."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "OARLOCK", "VIRTUAL_ENV"))
    }
    if programs == Path(sys.executable).parent and "PYTHONPATH" in os.environ:  # the checkout itself
        kept["PYTHONPATH"] = os.environ["PYTHONPATH"]
    return {**kept, "PATH": f"{programs}{os.pathsep}{kept.get('PATH', '')}", "BROWSER": "true"}


def measured(python: Path = Path(sys.executable)) -> dict[str, Any]:
    """Run all tutorials with a Python in which Oarlock is installed.

    Raises:
        RuntimeError: a command failed.
    """
    found: dict[str, Any] = {}
    for name in TUTORIALS:
        with TemporaryDirectory() as folder:
            found[name] = [
                {"command": text, "s": round(s, 1)} for text, s in run(name, python.parent, Path(folder))
            ]
    return {"machine": machine(), "tutorials": found}


def machine() -> str:
    """The machine in words."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    busy = f", where {os.getloadavg()[0]:.0f} programs wanted a core" if hasattr(os, "getloadavg") else ""
    return f"{cores} cores ({platform.machine()}, {platform.system()}){busy}"


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The table of each tutorial's commands and times."""
    made = f"{made_text(record)}, installed from a wheel, on {record['machine']}; "
    made += "`make pages PAGES=tutorials` measures it anew."
    found = {}
    for name, commands in record["tutorials"].items():
        rows = [[f"`{one['command'].replace('|', chr(92) + '|')}`", f"{one['s']:.1f}"] for one in commands]
        total = sum(one["s"] for one in commands)
        shown = table(("command", "s"), [*rows, ["all", f"{total:.1f}"]])
        found[f"docs/tutorials/{name}.md"] = {"times": f"{shown}\n\n{made}"}
    return found
