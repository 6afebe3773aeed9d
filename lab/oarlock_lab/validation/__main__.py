"""Runs all data sets that are there, and writes the page and the figures."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from . import broad, dfjimu, diodem, openaxes, others, page, people, qmt, singular
from .results import SetResult

SETS: dict[str, Callable[[Path], SetResult]] = {
    "people": people.run,
    "dfjimu": dfjimu.run,
    "diodem": diodem.run,
    "openaxes": openaxes.run,
    "broad": broad.run,
    "qmt": qmt.run,
    "singular": singular.run,
}


def main(arguments: list[str] | None = None) -> int:
    """Exit 0 where at least one set has run, 1 where none has."""
    parser = argparse.ArgumentParser(prog="python -m oarlock_lab.validation", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/validation"), help="folder to write")
    parser.add_argument("--only", nargs="+", choices=list(SETS), default=list(SETS), help="sets to run")
    options = parser.parse_args(arguments)
    results = run(options.only)
    for path in page.write(results, others.versions(), options.out):
        print(f"wrote {path}")
    return 0 if any(not r.absent for r in results) else 1


def run(names: Sequence[str]) -> list[SetResult]:
    """The results of these sets; those without data are named as absent."""
    data = Path(os.environ.get("OARLOCK_DATA") or "absent") / "data"
    if not data.is_dir():
        print("OARLOCK_DATA names no folder with data/ in it: only the simulated part runs", file=sys.stderr)
    return [_timed(name, data) for name in names]


def _timed(name: str, data: Path) -> SetResult:
    began = time.perf_counter()
    result = SETS[name](data)
    outcome = f"absent: {result.absent}" if result.absent else f"done in {time.perf_counter() - began:.0f} s"
    print(f"{name}: {outcome}", flush=True)
    return result


if __name__ == "__main__":
    sys.exit(main())
