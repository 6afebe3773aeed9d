"""Counts the instructions of single steps with callgrind, which neighbours on the machine do not change.

`python -m oarlock_lab.bench.counted` prints them beside the record in docs/figures/instructions.json; with
`--keep` they become the record. valgrind runs the AVX2 kernels also where the processor has AVX-512.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from oarlock_lab.pages.record import ROOT, stamped

RECORD: Final = ROOT / "docs/figures/instructions.json"
BODIES: Final = ("sculler", "sculler with biases and surge", "arms of 29 hinges")
STEPS: Final = 300
MAX_GROWTH: Final = 0.05
"""A step may take this much more than on record."""
MAX_TAIL: Final = 1.3
"""The 99 % quantile of the steps, relative to their median: no step waits for work that others avoid."""

Counts = dict[str, dict[str, float]]


class NotCounted(Exception):
    """Why nothing can be counted here."""


def counts(bodies: tuple[str, ...] = BODIES, steps: int = STEPS) -> Counts:
    """Median and 99 % quantile of the instructions of a step, for each body.

    Raises:
        NotCounted: there is no valgrind, or it does not know an instruction of this build.
    """
    if shutil.which("valgrind") is None:
        raise NotCounted("valgrind is not installed; `apt-get install valgrind` adds it")
    program = _built()
    steps_of_bodies = {body: _steps(program, body, steps) for body in bodies}
    return {
        body: {"median": float(np.median(each)), "p99": float(np.percentile(each, 99))}
        for body, each in steps_of_bodies.items()
    }


def compiler() -> str:
    """Version of the compiler: another one makes other instructions of the same code."""
    return subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.strip()


def grown(now: Mapping[str, Mapping[str, float]], before: Mapping[str, Mapping[str, float]]) -> Counts:
    """The bodies whose median step takes `MAX_GROWTH` more than before, with both medians."""
    return {
        body: {"before": before[body]["median"], "now": each["median"]}
        for body, each in now.items()
        if body in before and each["median"] > (1.0 + MAX_GROWTH) * before[body]["median"]
    }


def _built() -> Path:
    command = ["cargo", "bench", "--locked", "--package", "oarlock", "--bench", "counted", "--no-run"]
    built = subprocess.run(
        [*command, "--message-format=json"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    made = [json.loads(line) for line in built.stdout.splitlines()]
    return next(Path(message["executable"]) for message in reversed(made) if message.get("executable"))


def _steps(program: Path, body: str, steps: int) -> list[int]:
    with TemporaryDirectory() as folder:
        out = Path(folder) / "step"
        # Written at the end of each step: what happened since the step before.
        count = ["valgrind", "--tool=callgrind", "--dump-after=*counted_step*"]
        done = subprocess.run(
            [*count, f"--callgrind-out-file={out}", str(program), body, str(steps)],
            capture_output=True,
            text=True,
        )
        if "Illegal opcode" in done.stderr:
            raise NotCounted(f"this valgrind does not know an instruction of the steps of {body!r}")
        done.check_returncode()
        return [_total(out.with_name(f"step.{number}")) for number in range(2, steps + 1)]


def _total(dump: Path) -> int:
    match = re.search(r"^summary: (\d+)", dump.read_text(encoding="utf-8"), re.M)
    if match is None:
        raise ValueError(f"{dump}: callgrind wrote no summary")
    return int(match[1])


def main() -> None:
    """Reads the command line."""
    command = argparse.ArgumentParser(prog="python -m oarlock_lab.bench.counted", description=__doc__)
    command.add_argument("--keep", action="store_true", help="make these counts the record, for a release")
    keep = command.parse_args().keep
    now = counts()
    before = json.loads(RECORD.read_text(encoding="utf-8"))["bodies"] if RECORD.exists() else {}
    for body, each in now.items():
        then = f"{before[body]['median']:.0f}" if body in before else "not recorded"
        print(f"{body}: {each['median']:.0f} instructions a step, p99 {each['p99']:.0f}; on record {then}")
    if keep:
        record = stamped({"compiler": compiler(), "bodies": now})
        RECORD.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
