"""`run_job`: from a stored recording to a stored result; what a process is given to do."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from oarlock import Calibration, Config, DivergedError, Model, Track, load_recording, smooth, track
from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.interval import Interval
from oarlock.rowing import StrokeTable, load_export, save_strokes, technique
from oarlock.season.add import done_record
from oarlock.season.entry import Entry, entry_place
from oarlock.season.layout import RUN_FILE, STROKES_FILE, recording_folder, result_folder
from oarlock.season.run.job import Job, Reply, versions
from oarlock.season.run.setups import opened_setup
from oarlock.season.run_record import RunRecord, Setup
from oarlock.season.store import Season, open_season
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes

_LONGEST_FAULT = 600
_NOT_ITS_FAULT = (OSError, KeyboardInterrupt, SystemExit)
"""Of the machine, not of the recording."""


@dataclass(frozen=True)
class Tools:
    """What the recordings of one setup are computed with; no model for exports."""

    season: Season
    setup: Setup
    model: Model | None
    calibration: Calibration | None
    config: Config


@dataclass(frozen=True)
class StrokesAndHealth:
    """Strokes of a recording, None where it has none, and numbers about its sensors by name."""

    strokes: StrokeTable | None
    health: dict[str, float]


Compute = Callable[[Entry, Tools], StrokesAndHealth]


def run_job(job: Job, compute: Compute | None = None) -> Reply:
    """Compute a recording and store its result, or the reason why there is none.

    Args:
        job: which.
        compute: from an entry to strokes; None is `computed`.
    """
    if (other := _other_versions(job)) is not None:
        return Reply("refused", other)
    try:
        tools = _tools(job.season, job.setup)
        if _ended(tools.season, job):
            return Reply("there")
        entry = tools.season.entry(job.recording)
    except (ValueError, TypeError, OSError) as error:
        return Reply("refused", str(error))
    if entry is None or not entry.files:
        return Reply("removed", "its raw data are not there any more")
    began = time.perf_counter()
    try:
        record, files = _recorded(job, entry, tools, compute or computed)
        computed_s = time.perf_counter() - began
        is_new = commit(tools.season, record, files, tools.setup, job.again)
    except (DataError, OSError) as error:
        return Reply("refused", str(error))
    return Reply(record.status, record.fault, computed_s) if is_new else Reply("there", "", computed_s)


def computed(entry: Entry, tools: Tools) -> StrokesAndHealth:
    """Strokes of a recording or an export.

    Raises:
        DataError: a file is damaged, or there is nothing to find strokes in.
        DivergedError: the filter diverged.
    """
    with TemporaryDirectory() as scratch:
        folder = Path(scratch, "recording")
        try:
            fetch(tools.season, entry, folder)
            if entry.kind == "export":
                found = load_export(folder / next(iter(entry.files)))
                return StrokesAndHealth(found if isinstance(found, StrokeTable) else None, {})
            return tracked(folder, tools)
        except (DataError, DivergedError) as error:
            raise DataError(_named(error, str(folder), recording_folder(entry.recording))) from error


def tracked(folder: Path, tools: Tools) -> StrokesAndHealth:
    """Strokes of a recording's folder, from a smoothed track. Curves are left out: they are 9 of 10 bytes."""
    assert tools.model is not None
    found = smooth(track(tools.model, load_recording(folder), tools.calibration, tools.config))
    table = technique(found, calibration=tools.calibration).strokes
    return StrokesAndHealth(replace(table, curves={}), sensor_health(found))


def sensor_health(found: Track) -> dict[str, float]:
    """Numbers of each sensor: ``NAME.missing`` and ``NAME.rejected`` are shares of the readings expected and received.

    ``NAME.nis`` is the normalised innovation squared per reading, 1 where the model fits (`sensor_scores`).
    """
    health: dict[str, float] = {}
    for score in sensor_scores(found, Interval(-np.inf, np.inf)):
        if np.isfinite(score.nis):
            health[f"{score.name}.nis"] = float(score.nis)
        if (count := score.count) is not None:
            health[f"{score.name}.missing"] = count.missing / max(count.expected, 1)
            health[f"{score.name}.rejected"] = count.rejected / max(count.received, 1)
    return health


def fetch(season: Season, entry: Entry, folder: Path) -> None:
    """Copy the files of a recording into a new folder and compare them with their hashes.

    Raises:
        DataError: one is missing, damaged or cannot be read.
    """
    for name, expected in entry.files.items():
        full = f"{recording_folder(entry.recording)}/{name}"
        advice = "restore it from a backup, then run with --again-failed"
        try:
            contents = season.place.read(full)
        except FileNotFoundError:
            raise DataError(f"{full}: is missing; {advice}") from None
        except OSError as error:
            raise DataError(f"{full}: cannot be read ({error.strerror}); {advice}") from error
        if hashlib.sha256(contents).hexdigest() != expected:
            raise DataError(f"{full}: is damaged: its SHA-256 differs from the recorded one; {advice}")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(contents)


def commit(season: Season, record: RunRecord, files: dict[str, bytes], setup: Setup, again: bool) -> bool:
    """Store a result; False if another writer was first, or the recording was erased meanwhile.

    A record of a failure gives way to a result, and to another failure if it is computed again.
    """
    folder = result_folder(record.recording, record.run)
    try:
        before = season.run_record(record.recording, record.run)
        gives_way = before is not None and before.status == "failed" and (again or record.status == "done")
    except DataError:  # damaged
        gives_way = True
    if gives_way:
        season.place.remove_folder(folder, RUN_FILE)
    is_new = season.put_result(record, files, setup)
    # Looked at afterwards: an erasure that began before finds the result, or this finds that it began.
    if season.place.exists(entry_place(recording_folder(record.recording))):
        return is_new
    season.place.remove_folder(folder, RUN_FILE)
    return False


def failed_record(job: Job, setup: Setup, fault: str) -> RunRecord:
    """The record of a run that found nothing, and why."""
    engine = dict(job.versions)["oarlock"]
    return RunRecord(
        job.recording, job.run, engine, job.setup, setup.comparable(engine), "failed", fault[:_LONGEST_FAULT]
    )


def _recorded(job: Job, entry: Entry, tools: Tools, compute: Compute) -> tuple[RunRecord, dict[str, bytes]]:
    try:
        found = compute(entry, tools)
    except _NOT_ITS_FAULT:
        raise
    except MemoryError:
        return failed_record(job, tools.setup, "it needs more memory than there is"), {}
    except BaseException as error:  # a panic of the engine is no Exception
        words = str(error) if isinstance(error, DataError) else f"{type(error).__name__}: {error}"
        return failed_record(job, tools.setup, words), {}
    engine = dict(job.versions)["oarlock"]
    count = 0 if found.strokes is None else len(found.strokes)
    strokes = b"" if found.strokes is None else stroke_bytes(found.strokes)
    record = done_record(job.recording, tools.setup, engine, strokes, count, found.health)
    return (record, {STROKES_FILE: strokes}) if count else (replace(record, files={}), {})


def stroke_bytes(table: StrokeTable) -> bytes:
    """The file of a table of strokes: the same bytes for the same numbers."""
    with TemporaryDirectory() as scratch:
        return read_bytes(save_strokes(table, Path(scratch, "strokes"))[1])


@lru_cache(maxsize=64)
def _tools(address: str, setup: str) -> Tools:
    season = open_season(address)
    if setup == Setup().name:
        return Tools(season, Setup(), None, None, Config())
    files = season.load_setup(setup)
    return Tools(season, files, *opened_setup(files))


def _ended(season: Season, job: Job) -> bool:
    try:
        record = season.run_record(job.recording, job.run)
    except DataError:  # damaged: it is computed again
        return False
    return record is not None and not (job.again and record.status == "failed")


def _other_versions(job: Job) -> str | None:
    here = dict(versions())
    for name, version in job.versions:
        if here[name] != version:
            return (
                f"the process that computes has {name} {here[name]}, and this command {version}; their results would "
                "differ. Install the same versions everywhere and start the workers again"
            )
    return None


def _named(error: Exception, place: str, name: str) -> str:
    words = str(error) if isinstance(error, DataError) else f"the filter diverged: {error}"
    return words.replace(place, name)
