"""Time and memory of whole recordings, in processes of their own: reading, tracking, smoothing, `oarlock track`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

Figures = dict[str, float]

HOUR_S = 3600.0
SHORT_S = 40.0

_CHILD = """
import json, resource, sys, time
import oarlock
model = oarlock.load_model("sculler")
import oarlock.recording.folder
parts, begun = sys.argv[2].split(","), time.process_time()
if "load" in parts:
    recording = oarlock.load_recording(sys.argv[1])
if "track" in parts:
    track = oarlock.track(model, recording)
if "smooth" in parts:
    track = oarlock.smooth(track)
spent_s = time.process_time() - begun
if sys.platform == "linux":  # ru_maxrss would count the process that started this one
    status = open("/proc/self/status").read()
    peak_mib = int(status.split("VmHWM:")[1].split()[0]) / 1024
else:
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
print(json.dumps({"peak_mib": peak_mib, "spent_s": spent_s}))
"""

_PARTS = {"imports": "", "recording": "load", "track": "load,track", "smooth": "load,track,smooth"}


def whole_recordings(duration_s: float) -> dict[str, Any]:
    """Peak memory, MiB, and processor time, s, with a recording of this length, and of an hour.

    An hour's are on the line through those of this length and of `SHORT_S`, so that imports count once; 800 s are
    enough that `smooth` reuses the memory of `track`, as it does for an hour. `verb` is `oarlock track --smooth` with
    its report.
    """
    if duration_s <= SHORT_S:
        raise ValueError(f"a recording of {duration_s:g} s is too short, expected more than {SHORT_S:g} s")
    with TemporaryDirectory() as name:
        long, short = Path(name) / "long", Path(name) / "short"
        _simulated(duration_s, long)
        _simulated(SHORT_S, short)
        figures: dict[str, Any] = {
            stage: _of_hour(duration_s, _spent(short, parts), _spent(long, parts))
            for stage, parts in _PARTS.items()
        }
        figures["csv"] = _of_hour(duration_s, _spent(short, "load", "csv"), _spent(long, "load", "csv"))
        once = min((_verb(short) for _ in range(3)), key=lambda row: row["spent_s"])
        figures["verb"] = _of_hour(duration_s, once, _verb(long))
    return {"duration_s": duration_s, "short_s": SHORT_S, **figures}


def _of_hour(duration_s: float, short: Figures, long: Figures) -> dict[str, Figures]:
    share = (HOUR_S - duration_s) / (duration_s - SHORT_S)
    hour = {name: long[name] + share * (long[name] - short[name]) for name in long}
    return {"short": short, "long": long, "hour": hour}


def _simulated(duration_s: float, folder: Path) -> None:
    import oarlock
    from oarlock.recording.folder import write_folder
    from oarlock.rowing.simulation.experiment import simulate_sculling

    _, recording = simulate_sculling(oarlock.load_model("sculler"), "B-B", duration_s, seed=2)
    write_folder(list(recording), recording.meta, folder / "parquet")
    write_folder(list(recording), recording.meta, folder / "csv", "csv")


def _spent(folder: Path, parts: str, file_format: str = "parquet") -> Figures:
    command = [sys.executable, "-c", _CHILD, str(folder / file_format), parts]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    figures: Figures = json.loads(done.stdout)
    return figures


def _verb(folder: Path) -> Figures:
    command = [sys.executable, "-m", "oarlock", "track", str(folder / "parquet"), "--model", "sculler"]
    command += ["--smooth", "--out", str(folder / "out"), "--force"]
    before = os.times()
    subprocess.run(command, capture_output=True, check=True)
    after = os.times()
    spent_s = after.children_user + after.children_system - before.children_user - before.children_system
    return {"spent_s": spent_s}
