"""Exports with wounds: read, or refused with a reason."""

from pathlib import Path

import numpy as np
import pytest

from fuzz_wounds import feed
from oarlock.rowing import EXPORT_FORMATS, Activity, load_export, save_strokes, summarise_strokes

EXAMPLES = Path(__file__).parents[1] / "examples/strokes"
FILES = sorted(file.name for file in EXAMPLES.glob("*.csv"))
MADE = {
    "ergdata": "Stroke Number,Time (seconds),Distance (meters),Pace (seconds per 500m,Stroke Rate\n"
    "1,3.9,12,172,20\n2,7,23,160,20\n",
    "rowpro": "Time,Distance,Pace,Watts,Cals,SPM,HR,DutyCycle,Rowfile_Id\n"
    "878,3,0.29,106,0,0,74,0.3,\n3178,11,0.26,147,1,26,79,0.3,\n",
    "boatcoach": "workoutType,strokeRate,strokeCount,strokeDriveTime,strokePeakForce,workTime,stroke500MPace\n"
    "Time,20,1,0.9,100,0:00:02,0:03:02\nTime,20,1,0.9,100,0:00:03,0:03:02\n",
    "rowingdata": "index,TimeStamp (sec), Cadence (stokes/min), Stroke500mPace (sec/500m), lapIdx, Stroke Number,"
    "catch,finish,slip\n0,1777620600.5,24,120,0,1,-55,40,5\n1,1777620603,24,inf,0,2,-54,40,0\n"
    "2,1777620605.5,24,121,0,3,0,0,0\n",
    "concept2-logbook": "Number,Time (seconds),Distance (meters),Pace (seconds),Watts,Cal/Hr,Stroke Rate,Heart Rate\n"
    "1,2.5,10,125,180,900,24,120\n2,5,20,124,181,905,24,\n",
}
MOST_CHARACTERS = 6000


def looked_at(file: Path) -> None:
    table = load_export(file)
    if isinstance(table, Activity):
        assert table.duration_s is None or np.isfinite(table.duration_s)
        return
    assert table.duration_s is None or np.isfinite(table.duration_s)
    for name, values in table.columns.items():
        assert not np.isinf(values).any(), name
        assert all(table.reason(name)[row] for row in np.flatnonzero(np.isnan(values))), name
    summarise_strokes(table)
    save_strokes(table, file.parent / "out")


@pytest.mark.parametrize("name", FILES)
def test_wounded_examples(name, tmp_path):
    lines = (EXAMPLES / name).read_text(encoding="utf-8").splitlines(keepends=True)
    text = "".join(lines[: 1 + next(k for k in range(len(lines)) if k == len(lines) - 1 or _long(lines, k))])
    feed(tmp_path / name, text, looked_at)


def _long(lines, k):
    return k > 40 or len("".join(lines[: k + 1])) > MOST_CHARACTERS


@pytest.mark.parametrize("format", MADE)
def test_wounded_logs(format, tmp_path):
    assert format in EXPORT_FORMATS
    feed(tmp_path / "log.csv", MADE[format], looked_at)


def test_wounded_bytes(tmp_path):
    feed(tmp_path / "log.csv", (EXAMPLES / "rp3.csv").read_bytes()[:3000], looked_at)
