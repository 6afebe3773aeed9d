"""Small seasons for tests: recordings of noise, and strokes with known numbers."""

from __future__ import annotations

import datetime
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from oarlock import Recording
from oarlock.recording import ImuStream
from oarlock.rowing import StrokeTable, save_strokes
from oarlock.season import Admission, Athlete, RunRecord, Season, Setup

SETUP = Setup(model=b'name = "sculler"\n')


def noise(seed: int, day: str = "2026-03-04", seconds: float = 0.4) -> Recording:
    """A recording of one unit."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(50 * seconds)) / 50.0
    gyro, accel = rng.normal(size=(2, len(time_s), 3))
    return Recording(
        [ImuStream("trunk", time_s, gyro, accel)], {"clock": {"kind": "utc", "zero": f"{day}T10:00:00Z"}}
    )


def squad(season: Season, *pseudonyms: str) -> None:
    """Athletes with these pseudonyms."""
    for name in pseudonyms:
        season.put_athlete(Athlete(name, {"stature_m": 1.8}, {"coaching": "2026-01-01"}))


def add_noise(season: Season, athlete: str, seed: int, day: str = "2026-03-04") -> str:
    """Name of a new recording of noise."""
    added = Admission(season, athlete).add_recording(noise(seed, day), {"boat": "1x"})
    return added.entry.recording


def strokes_of(folder: Path, seed: int, count: int = 5) -> bytes:
    """A file of strokes; the catch angle of stroke k is -1 - k / 1000 - seed / 100, rad."""
    angle = -1.0 - np.arange(count) / 1000.0 - seed / 100.0
    rate = np.full(count, 22.0)
    rate[-1] = np.nan
    table = StrokeTable(
        {"catch_angle_rad": angle, "rate_per_min": rate}, {"catch_angle_rad": np.full(count, 0.01)}
    )
    return save_strokes(table, folder / f"strokes_{seed}")[1].read_bytes()


def add_strokes(
    season: Season,
    recording: str,
    folder: Path,
    seed: int,
    engine: str = "0.1.0",
    setup: Setup = SETUP,
    athlete: str = "",
) -> str:
    """Name of the run that has these strokes as its result; without `athlete` the recording is there."""
    contents = strokes_of(folder, seed)
    record = RunRecord.done(recording, setup, engine, contents, 5, {})
    owner = athlete or season.recordings()[recording]
    season.put_result(owner, record, {"strokes.parquet": contents}, setup)
    return record.run


def day(number: int) -> str:
    """A day of 2026, counted from its first."""
    return (datetime.date(2026, 1, 1) + datetime.timedelta(days=number)).isoformat()


def copied(season: Season, folder: str, out: Path) -> Path:
    """A folder of a season, as a folder on this disk."""
    for name, _ in season.place.files(folder):
        file = out / name.removeprefix(f"{folder}/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(season.place.read(name))
    return out


_WRITER = """
import sys, itertools
from pathlib import Path
from tempfile import mkdtemp
sys.path.insert(0, {tests!r})
import season_support as support
from oarlock.season import open_season
from oarlock.season.tables import update_tables
season = open_season({season!r})
scratch = Path(mkdtemp(dir={scratch!r}))
for seed in itertools.count({first}):
    if "add" in {does!r}:
        name = support.add_noise(season, {athlete!r}, seed, support.day(seed % 300))
    if "result" in {does!r}:
        support.add_strokes(season, name, scratch, seed, athlete={athlete!r})
    if "tables" in {does!r}:
        update_tables(season)
    print(seed, flush=True)
"""


@contextmanager
def writer(
    season: str | Path, first: int, does: str = "add", scratch: Path | None = None, athlete: str = "AAAAAA"
) -> Iterator[subprocess.Popen[str]]:
    """A process that stores recordings from a seed on, until the end of the block kills it; a line for each.

    It adds, stores results and updates tables, as the words of `does` say.
    """
    code = _WRITER.format(
        tests=str(Path(__file__).parent),
        season=str(season),
        first=first,
        does=does,
        athlete=athlete,
        scratch=None if scratch is None else str(scratch),
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(process: subprocess.Popen[str], lines: int) -> None:
    """Wait until a writer has printed so many lines."""
    assert process.stdout is not None
    for _ in range(lines):
        assert process.stdout.readline()
