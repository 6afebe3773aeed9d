"""`run_job`: from a stored recording to a stored result; `make_setup`, `choose_setup`: with which model."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np

from oarlock import Calibration, Config, DivergedError, Model, Track, load_recording, smooth, track
from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.interval import Interval
from oarlock.recording.calibration import calibration_text, parsed_calibration
from oarlock.rowing import StrokeTable, load_export, technique
from oarlock.rowing.alongside.course import course_of
from oarlock.rowing.analysis.rower_places import RowerFrames
from oarlock.rowing.strokes.files import strokes_parquet
from oarlock.season.records import SEASON_FILE, STROKES_FILE, Entry, RunRecord, Setup
from oarlock.season.run import Job, Reply, commit, failed_record, versions
from oarlock.season.store import Season, not_in_season, open_season
from oarlock.storage.errors import DataError
from oarlock.storage.toml import toml_text

_NONE = "none"
_NOT_ITS_FAULT = (OSError, KeyboardInterrupt, SystemExit)
"""Of the machine, not of the recording."""


def make_setup(model: Model, calibration: Calibration | None = None, config: Config | None = None) -> Setup:
    """The setup of a model with everything that it extends.

    Equal values give equal files, however they were written. What a calibration notes about its origin is left out.
    """
    RowerFrames(model)
    if dict(Model.from_toml(model.text, "model.toml", {}).parameters) != dict(model.parameters):
        raise DataError("setup: the model has lengths other than its file; give them in a calibration")
    text = "" if calibration is None else calibration_text(replace(calibration, noted={}))
    defaults: dict[str, Any] = Config().to_dict()
    own = {key: value for key, value in (config or Config()).to_dict().items() if value != defaults[key]}
    settings = toml_text({key: _NONE if own[key] is None else own[key] for key in sorted(own)})
    return Setup(model.text.encode(), text.encode(), settings.encode())


def choose_setup(season: Season, setup: Setup, athlete: str | None = None) -> Season:
    """Store a setup and make it the current one of an athlete, or of everybody without one of their own."""
    if athlete is None:
        season.put_setup(setup)
        now = open_season(season.place.address)  # it may have changed meanwhile
        changed = replace(now, place=season.place, setup=setup.name)
        season.place.write(SEASON_FILE, changed.toml())
        return changed
    known = season.athletes()
    if athlete not in known:
        raise not_in_season("athlete", athlete, known)
    season.put_setup(setup, athlete)
    season.put_athlete(replace(known[athlete], setup=setup.name))
    return season


@lru_cache(maxsize=64)
def opened_setup(setup: Setup) -> tuple[Model, Calibration | None, Config]:
    """What the files of a setup contain."""
    model = Model.from_toml(setup.model.decode(), "model.toml", {})
    calibration = parsed_calibration(setup.calibration.decode()) if setup.calibration else None
    values = tomllib.loads(setup.settings.decode())
    settings: dict[str, Any] = {key: None if value == _NONE else value for key, value in values.items()}
    return model, calibration, Config(**settings)


StrokesAndHealth: TypeAlias = tuple[StrokeTable | None, Mapping[str, float]]
"""Strokes of a recording, None where it has none, and numbers about its sensors by name."""
Compute: TypeAlias = Callable[[Season, Entry, Setup], StrokesAndHealth]


def run_job(job: Job, compute: Compute | None = None) -> Reply:
    """Compute a recording and store its result, or the reason why there is none; tests compute otherwise."""
    here = dict(versions())
    for name, version in job.versions:
        if here[name] != version:
            return Reply(
                "refused",
                f"the process that computes has {name} {here[name]}, and this command {version}; their results "
                "would differ. Install the same versions everywhere and start the workers again",
            )
    try:
        season, setup = _opened(job.season, job.setup, job.athlete)
        if setup.model:
            opened_setup(setup)
        with suppress(DataError):  # damaged: it is computed again
            record = season.run_record(job.athlete, job.recording, job.run)
            if record is not None and not (job.again and record.status == "failed"):
                return Reply("there")
        entry = season.entry(job.athlete, job.recording)
    except (ValueError, TypeError, OSError) as error:
        return Reply("refused", str(error))
    if entry is None or not entry.files:
        return Reply("removed", "its raw data are not there any more")
    began = time.perf_counter()
    try:
        record, files = _recorded(job, season, entry, setup, compute or computed)
        computed_s = time.perf_counter() - began
        is_new = commit(season, job, record, files, setup)
    except (DataError, OSError) as error:
        return Reply("refused", str(error))
    return Reply(record.status, record.fault, computed_s) if is_new else Reply("there", "", computed_s)


def _recorded(
    job: Job, season: Season, entry: Entry, setup: Setup, compute: Compute
) -> tuple[RunRecord, dict[str, bytes]]:
    try:
        table, health = compute(season, entry, setup)
    except _NOT_ITS_FAULT:
        raise
    except MemoryError:
        return failed_record(job, setup, "it needs more memory than there is"), {}
    except BaseException as error:  # a panic of the engine is no Exception
        words = str(error) if isinstance(error, DataError) else f"{type(error).__name__}: {error}"
        return failed_record(job, setup, words), {}
    engine = dict(job.versions)["oarlock"]
    if table is None or not len(table):
        return RunRecord.done(job.recording, setup, engine, b"", 0, health), {}
    strokes = strokes_parquet(table)
    left_out = int((table["in_averages"] == 0.0).sum()) if "in_averages" in table else 0
    record = RunRecord.done(job.recording, setup, engine, strokes, len(table), health, left_out)
    return record, {STROKES_FILE: strokes}


def computed(season: Season, entry: Entry, setup: Setup) -> StrokesAndHealth:
    """Strokes of a recording or an export.

    Curves of strokes are left out: they are 9 of 10 bytes.
    """
    with TemporaryDirectory() as scratch:
        folder = Path(scratch, "recording")
        try:
            fetch(season, entry, folder)
            if entry.kind == "export":
                export = load_export(folder / next(iter(entry.files)))
                if not isinstance(export, StrokeTable):
                    return None, {}
                counts = course_of(export).steady.astype(np.float64)
                return replace(export, columns={**export.columns, "in_averages": counts}), {}
            model, calibration, config = opened_setup(setup)
            smoothed = smooth(track(model, load_recording(folder), calibration, config))
            table = technique(smoothed, calibration=calibration).strokes
            return replace(table, curves={}), sensor_health(smoothed)
        except (DataError, DivergedError) as error:
            words = str(error) if isinstance(error, DataError) else f"the filter diverged: {error}"
            raise DataError(words.replace(str(folder), entry.folder)) from error


def sensor_health(smoothed: Track) -> dict[str, float]:
    """Numbers of each sensor: ``NAME.missing`` and ``NAME.rejected`` are shares of the readings expected and received.

    ``NAME.nis`` is the normalised innovation squared per reading, 1 where the model fits (`sensor_scores`).
    """
    health: dict[str, float] = {}
    for score in sensor_scores(smoothed, Interval(-np.inf, np.inf)):
        if np.isfinite(score.nis):
            health[f"{score.name}.nis"] = float(score.nis)
        if (count := score.count) is not None:
            health[f"{score.name}.missing"] = count.missing / max(count.expected, 1)
            health[f"{score.name}.rejected"] = count.rejected / max(count.received, 1)
    return health


def fetch(season: Season, entry: Entry, folder: Path) -> None:
    """Copy the files of a recording into a new folder and compare them with their hashes."""
    advice = "; restore it from a backup, then run with --again-failed"
    for name, sha256 in entry.files.items():
        contents = season.read_checked(f"{entry.folder}/{name}", sha256, advice)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(contents)


@lru_cache(maxsize=64)
def _opened(address: str, setup: str, athlete: str) -> tuple[Season, Setup]:
    season = open_season(address)
    return season, season.load_setup(setup, athlete)
