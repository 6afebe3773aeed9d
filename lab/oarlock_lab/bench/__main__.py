"""`make bench`, second half: measures the installed package, reads what `cargo bench` wrote, prints one table.

`python -m oarlock_lab.bench --page FILE` puts the table of the last run into a page, between its two marks.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import Any

from oarlock_lab.bench.measure import measure
from oarlock_lab.pages.record import stamped
from oarlock_lab.pages.sections import into_page

from .apart import costs
from .recordings import whole_recordings
from .startup import startups
from .table import write

OUT = Path("out/bench")
RUST = ("ratios", "latency", "many")
# what is benchmarked, and of how many samples one run consists
PARTS = ("kinematics", "update", "step", "track", "smooth")


def criterion(target: Path) -> dict[str, dict[str, float]]:
    """Median time, us, by part and number of states; of a recording, of one of its samples."""
    estimates: dict[str, dict[str, float]] = {part: {} for part in PARTS}
    for part in PARTS:
        for file in (target / "criterion" / part).glob("*/new/estimates.json"):
            size = file.parents[1].name
            count = json.loads((file.parent / "benchmark.json").read_text())["throughput"] or {}
            median_ns = json.loads(file.read_text())["median"]["point_estimate"]
            estimates[part][size] = 1e-3 * median_ns / count.get("Elements", 1)
    return estimates


def collect(seconds: float, recording_s: float) -> dict[str, Any]:
    """Everything that was measured, and what is measured now."""
    figures = stamped({name: json.loads((OUT / f"{name}.json").read_text()) for name in RUST})
    figures["load"] = os.getloadavg()[0]
    figures["criterion"] = criterion(Path(os.environ.get("CARGO_TARGET_DIR", "target")))
    figures["user"] = measure(seconds).to_dict()
    figures["apart"] = costs()
    figures["recordings"] = whole_recordings(recording_s)
    figures["startup"] = startups()
    return figures


def main() -> None:
    """Reads the command line."""
    command = argparse.ArgumentParser(prog="python -m oarlock_lab.bench", description=__doc__)
    command.add_argument(
        "--duration-s", type=float, default=20.0, help="time for the package's own measurements"
    )
    command.add_argument(
        "--recording-s", type=float, default=800.0, help="length of the recording that is tracked whole, s"
    )
    command.add_argument("--page", type=Path, help="only put the last run's tables into this page")
    arguments = command.parse_args()
    if arguments.page is not None:
        page = arguments.page.read_text(encoding="utf-8")
        arguments.page.write_text(
            into_page(page, (OUT / "table.md").read_text(encoding="utf-8")), encoding="utf-8"
        )
        return
    figures = collect(arguments.duration_s, arguments.recording_s)
    tables = write(figures)
    (OUT / "figures.json").write_text(json.dumps(figures, indent=2), encoding="utf-8")
    (OUT / "table.md").write_text(tables, encoding="utf-8")
    print(tables)
    print(f"Wrote {OUT}: table.md, figures.json. `make bench-page` puts the table into docs/performance.md.")


if __name__ == "__main__":
    main()
