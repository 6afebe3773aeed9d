"""Peak memory of tracking and smoothing, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

_CHILD = """
import resource, sys
import oarlock
model = oarlock.load_model("sculler")
import oarlock.recording.folder
parts = sys.argv[2].split(",")
if "load" in parts:
    recording = oarlock.load_recording(sys.argv[1])
if "track" in parts:
    track = oarlock.track(model, recording)
if "smooth" in parts:
    track = oarlock.smooth(track)
if sys.platform == "linux":  # ru_maxrss would count the process that started this one
    status = open("/proc/self/status").read()
    print(int(status.split("VmHWM:")[1].split()[0]) / 1024)
else:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2)
"""

_PARTS = {"imports": "", "recording": "load", "track": "load,track", "smooth": "load,track,smooth"}


def peaks(duration_s: float) -> list[dict[str, Any]]:
    """Peak resident memory, MiB: imports, the recording, tracked, smoothed too; and what each minute adds."""
    import oarlock
    from oarlock.rowing.simulation.experiment import simulate_sculling

    _, recording = simulate_sculling(oarlock.load_model("sculler"), "B-B", duration_s, seed=2)
    rows = []
    with TemporaryDirectory() as folder:
        recording.save(Path(folder) / "recording")
        for name, parts in _PARTS.items():
            command = [sys.executable, "-c", _CHILD, str(Path(folder) / "recording"), parts]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            rows.append({"what": name, "duration_s": duration_s, "peak_mib": float(done.stdout)})
    loaded = next(row["peak_mib"] for row in rows if row["what"] == "recording")
    for row in rows:
        row["mib_per_minute"] = (row["peak_mib"] - loaded) / (duration_s / 60.0)
    return rows
