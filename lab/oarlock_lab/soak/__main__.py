"""`make soak`: runs sessions with devices that misbehave, prints what was measured, and says what is wrong."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from oarlock_lab.soak.soak import Soaked, soak_live, soak_virtual, summary, write

OUT = Path("out/soak")


def _soak(minutes: float, hours: float, rate_hz: float) -> int:
    folder = OUT / time.strftime("%Y-%m-%d-%H%M%S")
    found: dict[str, Soaked] = {}
    if hours:
        found[f"{hours:g} h without waiting"] = soak_virtual(folder / "virtual", 3600.0 * hours, rate_hz)
    if minutes:
        found[f"{minutes:g} min in true time"] = soak_live(folder / "live", 60.0 * minutes, rate_hz)
    for name, one in found.items():
        print(summary(name, one))
    write(folder, found)
    print(f"Wrote {folder}")
    return int(any(one.problems for one in found.values()))


def main() -> int:
    """Reads the command line; 1 if a run has problems."""
    command = argparse.ArgumentParser(prog="python -m oarlock_lab.soak", description=__doc__)
    command.add_argument("--minutes", type=float, default=60.0, help="length of the session in true time")
    command.add_argument("--hours", type=float, default=10.0, help="length of the session without waiting")
    command.add_argument("--rate-hz", type=float, default=100.0, help="of all devices")
    asked = command.parse_args()
    return _soak(asked.minutes, asked.hours, asked.rate_hz)


if __name__ == "__main__":
    raise SystemExit(main())
