"""Runs as many parts of the long tier as end within the time given, another choice of them every hour.

A part is a file of tests with the mark `long`, the long tests of the engine, or some minutes of fuzzing. The parts
stand in a circle; the hour says where a run begins. A part that has begun is never cut short. What was left out is
printed.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

ROOT = Path(__file__).parents[1]
FUZZED = ("arrays", "settings", "files", "units", "wearings", "decoders", "messages", "import", "strokes")
CAMPAIGN_S = 5
# The same in every run, so that a change does not fail for what it did not touch; `make fuzz` draws new ones.
FUZZ_SEED = "1"
# Processor time of a part by itself, in seconds, rounded up; of fuzzing, pages and emulated devices, which wait, time
# by the clock. A part that is not named here is new.
USUAL_S = {
    "fuzz arrays": 35.0,
    "fuzz settings": 25.0,
    "fuzz wearings": 45.0,
    "fuzz units": 85.0,
    "fuzz import": 45.0,
    "fuzz strokes": 100.0,
    "test_apart": 25.0,
    "test_bodies_data": 75.0,
    "test_body_sessions": 880.0,
    "test_clock_lags": 10.0,
    "test_clocks": 10.0,
    "test_clocks_apart": 900.0,
    "test_compare": 10.0,
    "test_docs_commands": 150.0,
    "test_site": 120.0,
    "test_emulated_over_the_air": 60.0,
    "test_emulated_transports": 800.0,
    "test_events": 10.0,
    "test_exact_recordings": 50.0,
    "test_faults": 5.0,
    "test_field_simulator": 5.0,
    "test_findings_planted": 420.0,
    "test_folders_killed": 1500.0,
    "test_found_calibration": 50.0,
    "test_fuzz_files": 15.0,
    "test_hull": 5.0,
    "test_instructions": 150.0,
    "test_io_validation_data": 15.0,
    "test_magnetometer_lag": 10.0,
    "test_magnetometer_trust": 130.0,
    "test_motion_calibration": 120.0,
    "test_report_browser": 60.0,
    "test_release_built": 500.0,
    "test_reproduce": 20.0,
    "test_sagittal": 15.0,
    "test_strokes": 15.0,
    "test_strokes_crew_browser": 40.0,
    "test_stopped": 160.0,
    "test_suspects": 215.0,
    "test_season_cluster": 60.0,
    "test_season_bands": 30.0,
    "test_smoothing": 200.0,
    "test_soak": 80.0,
    "test_season_killed": 60.0,
    "test_sessions_killed": 700.0,
    "test_sweep": 10.0,
    "test_technique": 15.0,
    "test_guide_browser": 260.0,
    "test_movement_ranges": 150.0,
    "test_notebooks": 120.0,
    "test_outcomes": 200.0,
    "test_page_browser": 80.0,
    "test_swapped_units": 265.0,
    "test_two_hinges": 15.0,
    "test_units_apart": 15.0,
    "test_unobserved": 25.0,
    "test_video": 120.0,
    "test_video_browser": 30.0,
    "test_viewer_browser": 70.0,
    # Estimates from a run of all tests on two cores.
    "engine": 90.0,
    "memcheck": 60.0,
    "fuzz engine": 70.0,
    "fuzz decoders": 90.0,
    "fuzz messages": 65.0,
    "fuzz files": 220.0,
}
NEW_S = 60.0
# A machine that is shared is slower than the one that was measured.
ALLOWANCE = 1.5
SUMMARY = re.compile(
    r"^(?:=+ .*\d+ (?:passed|skipped).* =+|test result: .*|\d+ test functions.*|[\w-]+: NOT RUN.*)$", re.M
)


@dataclass(frozen=True)
class Part:
    """A command and how long it usually takes."""

    name: str
    command: list[str]
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def usual_s(self) -> float:
        """An estimate, s."""
        return USUAL_S.get(self.name, NEW_S)


def parts() -> list[Part]:
    """The circle."""
    cargo = ["cargo", "test", "--locked", "--quiet", "--package", "oarlock"]
    pytest = [sys.executable, "-m", "pytest"]
    fuzzing = {"OARLOCK_FUZZ_SECONDS": str(CAMPAIGN_S), "OARLOCK_FUZZ_SEED": FUZZ_SEED}
    files = sorted(
        path for path in (ROOT / "tests").rglob("test_*.py") if "mark.long" in path.read_text("utf-8")
    )
    return [
        Part("engine", [*cargo, "--test", "engine", "--", "--ignored"]),
        Part("memcheck", ["make", "--no-print-directory", "memcheck"]),
        *(Part(path.stem, [*pytest, "-m", "long", str(path.relative_to(ROOT))]) for path in files),
        Part("fuzz engine", [*cargo, "--test", "fuzz", "--", "--test-threads", "1"], fuzzing),
        *(Part(f"fuzz {name}", [*pytest, f"tests/test_fuzz_{name}.py"], fuzzing) for name in FUZZED),
    ]


class Run:
    """Parts that are taken from the circle while there is time; each prints its own summary lines when it ends."""

    def __init__(self, circle: list[Part], ends_s: float) -> None:
        self.waiting, self.ends_s = list(circle), ends_s
        self.failed: list[str] = []
        self.lock = Lock()

    def next(self) -> Part | None:
        """The first part that can end in time."""
        with self.lock:
            left_s = self.ends_s - time.monotonic()
            for part in self.waiting:
                if ALLOWANCE * part.usual_s <= left_s:
                    self.waiting.remove(part)
                    return part
        return None

    def work(self) -> None:
        """Run parts until none is left that can end in time."""
        while part := self.next():
            begun = time.monotonic()
            done = subprocess.run(
                part.command, cwd=ROOT, capture_output=True, text=True, env=os.environ | part.environment
            )
            with self.lock:
                self.tell(part, done, time.monotonic() - begun)

    def tell(self, part: Part, done: subprocess.CompletedProcess[str], took_s: float) -> None:
        """Print the summary of a part, and all that it said if it failed."""
        print(f"--- {part.name}: {took_s:.0f} s", flush=True)
        if done.returncode:
            self.failed.append(part.name)
            print(done.stdout, done.stderr, sep="\n", flush=True)
        else:
            print("\n".join(SUMMARY.findall(done.stdout)), flush=True)


def main() -> int:
    """Exit status: 1 if a part failed."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seconds", type=float, required=True, help="time that is left")
    asked.add_argument(
        "--turn", type=int, default=int(time.time() // 3600), help="repeats the choice of a run"
    )
    given = asked.parse_args()
    if given.seconds <= 0.0:
        print("long tier: no time is left, nothing is run", flush=True)
        return 0
    circle = parts()
    # Coprime to most numbers of parts, so that runs an hour apart begin far from each other.
    first = 7 * given.turn % len(circle)
    run = Run(circle[first:] + circle[:first], time.monotonic() + given.seconds)
    workers = os.cpu_count() or 1
    print(
        f"long tier: turn {given.turn}, {given.seconds / 60:.1f} min left, {workers} parts at once",
        flush=True,
    )
    with ThreadPoolExecutor(workers) as pool:
        for worker in [pool.submit(run.work) for _ in range(workers)]:
            worker.result()
    print("left out: " + (", ".join(part.name for part in run.waiting) or "nothing"))
    print("failed: " + (", ".join(run.failed) or "nothing"))
    return int(bool(run.failed))


sys.exit(main())
