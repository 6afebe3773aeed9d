"""`make soak`: runs sessions with devices that misbehave, prints what was measured, and says what is wrong."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from oarlock_lab.soak.soak import Soaked, soak_live, soak_virtual, summary, write

OUT = Path("out/soak")


def _soak(minutes: float, hours: float, rate_hz: float) -> int:
    folder = OUT / time.strftime("%Y-%m-%d-%H%M%S")
    runs: dict[str, Soaked] = {}
    if hours:
        runs[f"{hours:g} h without waiting"] = soak_virtual(folder / "virtual", 3600.0 * hours, rate_hz)
    if minutes:
        runs[f"{minutes:g} min in true time"] = soak_live(folder / "live", 60.0 * minutes, rate_hz)
    for name, soaked in runs.items():
        print(summary(name, soaked))
    write(folder, runs)
    print(f"Wrote {folder}")
    return int(any(soaked.problems for soaked in runs.values()))


def main() -> int:
    """Reads the command line; 1 if a run has problems."""
    command = argparse.ArgumentParser(prog="python -m oarlock_lab.soak", description=__doc__)
    command.add_argument("--minutes", type=float, default=60.0, help="length of the session in true time")
    command.add_argument("--hours", type=float, default=10.0, help="length of the session without waiting")
    command.add_argument("--rate-hz", type=float, default=100.0, help="of all devices")
    arguments = command.parse_args()
    return _soak(arguments.minutes, arguments.hours, arguments.rate_hz)


if __name__ == "__main__":
    raise SystemExit(main())
