"""Tracks one recording (`track`) and smooths a track (`smooth`): input checks, engine run, `Track`."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable
from os import PathLike
from typing import Unpack
from weakref import WeakKeyDictionary

import numpy as np

from oarlock import _core
from oarlock._core import Belief, Config, Model, Run
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected, correction_notes
from oarlock.recording.epoch import shift_notes
from oarlock.recording.plausibility import SignalFinding, require_plausible
from oarlock.recording.recording import Recording
from oarlock.recording.session_info import SESSION_KEY, session_info
from oarlock.recording.undetermined_mounts import mount_notes
from oarlock.storage.errors import DataError, DivergedError
from oarlock.storage.progress import Progress, shown
from oarlock.tracking.counts import count_streams
from oarlock.tracking.known_streams import known_streams, not_measured
from oarlock.tracking.settings import Settings
from oarlock.tracking.track import Track, notes_without_hinges, track_of_run

ROOM_TO_GIVE_BYTES = 100 * 2**20
"""Smoothing frees filtered estimates above this size that have not been read; reading them filters again."""


# A recording is immutable, so its checks are cached for further runs with other settings.
_FINDINGS: WeakKeyDictionary[Recording, tuple[SignalFinding, ...]] = WeakKeyDictionary()
_HASHES: WeakKeyDictionary[Recording, str] = WeakKeyDictionary()


def track(
    model: Model,
    recording: Recording,
    calibration: Calibration | None = None,
    config: Config | None = None,
    *,
    smooth: bool = False,
    start: Belief | None = None,
    progress: Progress = None,
    **settings: Unpack[Settings],
) -> Track:
    """Track a recording: a loop over `Tracker.step`.

    Args:
        model: the body and its sensors.
        recording: as measured; NaN and absent streams are missing data.
        calibration: of this session; None: nominal values, with a note.
        config: settings for several runs; keywords replace single ones.
        smooth: return the smoothed track.
        start: continue from this `Track.last_belief`.
        progress: True shows a bar.
        settings: of the filter (`Settings`), such as `filter="ekf"`.

    Raises:
        DataError: no stream of a sensor, a misspelt name, wrong time stamps or units.
        DivergedError: the filter diverged.
    """
    config = checked_config(config, settings)
    require_model(model)
    require_recording(recording)
    recording, left_out = known_streams(model, recording)
    findings = admit(model, corrected(recording, calibration))
    began = time.perf_counter()
    try:
        with shown(progress, "tracking") as told:
            run = _core.track(model, recording, calibration, config, start, told)
    except DivergedError as error:
        add_findings(error, findings)
        raise
    wall_s = time.perf_counter() - began
    filtered = finished(
        model,
        recording,
        calibration,
        run,
        (*run.notes, *left_out),
        findings,
        wall_s,
        resumed=start is not None,
    )
    return _smoothed(filtered, progress) if smooth else filtered


def checked_config(config: Config | None, settings: Settings) -> Config:
    """The settings of a run: those of the keywords, then those of `config`, then the defaults.

    Raises:
        DataError: no such setting, a value out of range, or settings that are no `Config`.
    """
    if config is not None and not isinstance(config, Config):
        raise DataError(
            f"track: config is a {type(config).__name__}, not a Config; give settings as keywords: "
            'track(model, recording, filter="ekf")'
        )
    if not settings:
        return config if config is not None else Config()
    shared = {} if config is None else config.to_dict()
    return Config(**(shared | dict(settings)))


def require_model(given: object) -> None:
    """Raise a DataError unless given a `Model`."""
    if not isinstance(given, Model):
        name = f'"{given}"' if isinstance(given, str | PathLike) else f"a {type(given).__name__}"
        raise DataError(f"track: the model is {name}, not a Model; load it: oarlock.load_model({name})")


def admit(model: Model, recording: Recording) -> list[SignalFinding]:
    """Warnings and notes on a recording, after checking that the model can track it.

    Missing readings of what the model does not measure, such as a magnetometer, are no finding.

    Raises:
        DataError: as `track`.
    """
    require_recording(recording)
    _require_one_clock(recording)
    if recording not in _FINDINGS:
        _FINDINGS[recording] = tuple(require_plausible(recording))
    ignored = {(unit.name, field) for unit in model.describe().inertial_units for field in not_measured(unit)}
    return [found for found in _FINDINGS[recording] if (found.sensor, found.missing) not in ignored]


def add_findings(error: DivergedError, findings: Iterable[SignalFinding]) -> None:
    """Add the findings of the plausibility checks to an error as notes."""
    for finding in findings:
        error.add_note(f"{finding.sensor}: {finding.message}")


def finished(
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    run: Run,
    run_notes: Iterable[str],
    findings: Iterable[SignalFinding],
    wall_s: float,
    smoothing_wall_s: float | None = None,
    resumed: bool = False,
) -> Track:
    """The track of a run with notes, counts and provenance; `run_notes` are the notes of the run."""
    provenance = {
        "oarlock": _core.__version__,
        "model": model.name,
        "model_sha256": hashlib.sha256(model.text.encode()).hexdigest(),
        "parameters": model.parameters | dict(calibration.parameters if calibration else {}),
        "recording_sha256": _hash(recording),
        **({} if recording.epoch is None else {"epoch": recording.epoch}),
        **({SESSION_KEY: dict(session)} if (session := session_info(recording.meta)) else {}),
        "config": run.config.to_dict(),
        "structure": run.structure,
        "nominal_mounts": run.nominal_mounts,
        "steps": run.steps,
        "wall_s": wall_s,
        "steps_per_s": run.steps / wall_s,
    }
    if resumed:
        provenance["resumed"] = True
    if smoothing_wall_s is not None:
        provenance["smoothing_wall_s"] = smoothing_wall_s
    if calibration is not None and calibration.parameters:
        model = model.with_parameters(calibration.parameters)
    notes = (
        *run_notes,
        *shift_notes(recording.meta),
        *correction_notes(recording, calibration),
        *mount_notes(recording, calibration),
        *(f"{f.sensor}: {f.message}" for f in findings),
    )
    counts = count_streams(corrected(recording, calibration), run.counts())
    return track_of_run(model, run, notes, provenance, counts, calibration)


def smooth(track: Track, recording: Recording | None = None, *, progress: Progress = None) -> Track:
    """Smooth a track (Rauch, Tung and Striebel 1965): each estimate uses later samples, too.

    Args:
        track: a result of `track`.
        recording: of a track from a folder, which has no samples.
        progress: True shows a bar.

    Raises:
        DataError: smoothed already, or `recording` is missing or another.
    """
    if track.run is None and recording is not None:
        track = _again(track, recording, progress)
    return _smoothed(track, progress)


def _again(loaded: Track, recording: Recording, progress: Progress) -> Track:
    """A loaded track with its run, from the recording that it was made of."""
    if loaded.smoothed or loaded.model is None or "config" not in loaded.provenance:
        raise DataError("smooth: the track is smoothed already, is simulated, or its model file is missing")
    if loaded.provenance.get("recording_sha256") != _hash(recording):
        raise DataError(
            "smooth: this is not the recording that the track was made of (recording_sha256 in run.toml differs). Give "
            "the same streams: recording.only(...), recording.without(...), recording.low_passed(...)"
        )
    config = Config(**loaded.provenance["config"])
    return track(loaded.model, recording, loaded.calibration, config, progress=progress)


def _smoothed(track: Track, progress: Progress) -> Track:
    if track.run is None or track.model is None:
        raise DataError(
            "smooth: this track has no samples (it was loaded from files, or is simulated). "
            "Give the recording that it was made of: oarlock.smooth(track, oarlock.load_recording(FOLDER))"
        )
    filtered_notes = track.run.notes
    began = time.perf_counter()
    with shown(progress, "smoothing") as told:
        run = track.run.smooth(ROOM_TO_GIVE_BYTES, told)
    provenance = dict(track.provenance) | {"smoothing_wall_s": time.perf_counter() - began}
    # Smoothing can determine joints that the filter alone does not, so the notes of the run are made again.
    others = [note for note in notes_without_hinges(track) if note not in filtered_notes]
    return track_of_run(track.model, run, (*run.notes, *others), provenance, track.counts, track.calibration)


def require_recording(given: object) -> None:
    """Raise a DataError unless given a `Recording`."""
    if not isinstance(given, Recording):
        kind = type(given).__name__
        raise DataError(
            f"track: expected a Recording, got {kind}; read one from a folder with oarlock.load_recording"
        )


def _require_one_clock(recording: Recording) -> None:
    spans = [(s.name, s.time_s[0], s.time_s[-1]) for s in recording.streams if len(s)]
    for name, first, last in spans:
        others = [other for other in spans if other[0] != name]
        if others and all(first > end or last < begin for _, begin, end in others):
            other = others[0]
            raise DataError(
                f'stream "{name}" lasts from {first:.3f} to {last:.3f} s and overlaps with no other stream '
                f'("{other[0]}": {other[1]:.3f} to {other[2]:.3f} s): their clocks or units of time differ. '
                "Convert all streams to one clock, or leave this one out with recording.only(...)"
            )


def _hash(recording: Recording) -> str:
    if recording not in _HASHES:
        _HASHES[recording] = _digest(recording)
    return _HASHES[recording]


def _digest(recording: Recording) -> str:
    digest = hashlib.sha256()
    for stream in recording.streams:
        digest.update(stream.name.encode())
        digest.update(np.ascontiguousarray(stream.time_s).data)
        for name, values in stream.values.items():
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(values).data)
    return digest.hexdigest()
