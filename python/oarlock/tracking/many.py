"""Tracks many recordings of one model in parallel (`track_many`). Each result is identical to that of `track`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, TypeVar, overload

from oarlock import _core
from oarlock._core import Config, Model, Run
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.plausibility import SignalFinding
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError, DivergedError, ModelError
from oarlock.storage.progress import Progress, Told, shown
from oarlock.tracking.known_streams import known_streams
from oarlock.tracking.track import Track
from oarlock.tracking.tracking import add_findings, admit, finished, require_recording

Failure: TypeAlias = ModelError | DataError | DivergedError
_AnyFailure = TypeVar("_AnyFailure", bound=Exception)
_Part = TypeVar("_Part", Calibration, Config)
Job: TypeAlias = tuple[Recording, Calibration | None, Config]
_Ended: TypeAlias = tuple[Run, list[str], float, float | None] | Failure


@overload
def track_many(
    model: Model,
    recordings: Iterable[Recording],
    calibration: Calibration | Sequence[Calibration | None] | None = None,
    config: Config | Sequence[Config | None] | None = None,
    *,
    smooth: bool = False,
    threads: int | None = None,
    on_error: Literal["raise"] = "raise",
    progress: Progress = None,
) -> list[Track]: ...


@overload
def track_many(
    model: Model,
    recordings: Iterable[Recording],
    calibration: Calibration | Sequence[Calibration | None] | None = None,
    config: Config | Sequence[Config | None] | None = None,
    *,
    smooth: bool = False,
    threads: int | None = None,
    on_error: Literal["return"],
    progress: Progress = None,
) -> list[Track | Failure]: ...


def track_many(
    model: Model,
    recordings: Iterable[Recording],
    calibration: Calibration | Sequence[Calibration | None] | None = None,
    config: Config | Sequence[Config | None] | None = None,
    *,
    smooth: bool = False,
    threads: int | None = None,
    on_error: Literal["raise", "return"] = "raise",
    progress: Progress = None,
) -> list[Track] | list[Track | Failure]:
    """Track recordings of one model on several cores, with the same results as `track`.

    Args:
        model: the same for all.
        recordings: such as trials of a season.
        calibration: for all, or one each.
        config: for all, or one each.
        smooth: smooth each track.
        threads: recordings at a time; None: all cores.
        on_error: "raise" the first after all are tracked, or "return" each in place of its track.
        progress: True shows a bar.

    Returns:
        Tracks in the same order, all in memory.

    Raises:
        DataError: as `track`, with the recording's index; or lengths that differ.
        DivergedError: as `track`.
    """
    given = _checked(model, recordings, threads, on_error)
    calibrations = _one_each(calibration, Calibration, "calibration", len(given))
    configs = [c if c is not None else Config() for c in _one_each(config, Config, "config", len(given))]
    labels = [_label(index, recording) for index, recording in enumerate(given)]
    jobs = dict(zip(labels, zip(given, calibrations, configs, strict=True), strict=True))
    stop = on_error == "raise"
    with shown(progress, f"tracking {len(jobs)} recordings") as told:
        results = outcomes(model, jobs, smooth=smooth, threads=threads, stop_on_refusal=stop, progress=told)
    return [_track_or_raise(result) for result in results] if stop else results


def outcomes(
    model: Model,
    jobs: Mapping[str, Job],
    *,
    smooth: bool,
    threads: int | None,
    stop_on_refusal: bool,
    progress: Told | None,
) -> list[Track | Failure]:
    """The result or the error of each job, in order. The text of an error begins with the key of its job.

    Raises:
        DataError: `stop_on_refusal` is set and a recording is refused before any is tracked.
    """
    results: dict[str, Track | Failure] = {}
    admitted: dict[str, tuple[Job, list[SignalFinding], tuple[str, ...]]] = {}
    for label, (whole, calibration, config) in jobs.items():
        try:
            require_recording(whole)
            recording, left_out = known_streams(model, whole)
            findings = admit(model, corrected(recording, calibration))
            admitted[label] = ((recording, calibration, config), findings, left_out)
        except DataError as error:
            results[label] = refused = _named(error, label)
            if stop_on_refusal:
                raise refused from None
    runs = _core.track_many(model, [job for job, _, _ in admitted.values()], smooth, threads, progress)
    for (label, (job, odd, left_out)), run in zip(admitted.items(), runs, strict=True):
        results[label] = _result(model, label, job, run, odd, left_out)
    return [results[label] for label in jobs]


def _label(index: int, recording: object) -> str:
    source = _source(recording) if isinstance(recording, Recording) else ""
    return f"recordings[{index}] ({source})" if source else f"recordings[{index}]"


def _source(recording: Recording) -> str:
    """Source of a recording in a word or two; empty if it is unknown."""
    source = recording.meta.get("source")
    if isinstance(source, Mapping):
        source = next((source[key] for key in ("file", "mapping", "run") if key in source), None)
    return source if isinstance(source, str) else ""


def _checked(model: object, recordings: object, threads: object, on_error: object) -> list[Recording]:
    if not isinstance(model, Model):
        raise DataError(
            f"track_many: expected one Model for all recordings, got {type(model).__name__}. "
            "Call track_many once for each model"
        )
    if isinstance(recordings, Recording) or not isinstance(recordings, Iterable):
        kind = type(recordings).__name__
        raise DataError(
            f"track_many: expected a list of recordings, got {kind}; use oarlock.track for a single recording"
        )
    if on_error not in ("raise", "return"):
        raise DataError(f'track_many: on_error = {on_error!r}: expected "raise" or "return"')
    if threads is not None and (not isinstance(threads, int) or isinstance(threads, bool) or threads < 1):
        raise DataError(f"track_many: threads = {threads!r}: expected 1 or more, or None for all cores")
    return list(recordings)


def _one_each(given: object, kind: type[_Part], name: str, count: int) -> list[_Part | None]:
    if given is None or isinstance(given, kind):
        return [given] * count
    each: list[Any] = list(given) if isinstance(given, Sequence) else [given]
    for index, one in enumerate(each):
        if one is not None and not isinstance(one, kind):
            raise DataError(
                f"track_many: {name}[{index}] is a {type(one).__name__}; expected {kind.__name__} or None"
            )
    if len(each) != count:
        raise DataError(
            f"track_many: {len(each)} in {name} for {count} recordings; give one for all, or one for each"
        )
    return each


def _result(
    model: Model, label: str, job: Job, run: _Ended, findings: list[SignalFinding], left_out: tuple[str, ...]
) -> Track | Failure:
    recording, calibration, _ = job
    if not isinstance(run, tuple):
        if isinstance(run, DivergedError):
            add_findings(run, findings)
        return _named(run, label)
    done, notes, wall_s, smoothing_wall_s = run
    return finished(
        model, recording, calibration, done, (*notes, *left_out), findings, wall_s, smoothing_wall_s
    )


def _named(error: _AnyFailure, label: str) -> _AnyFailure:
    """The same error, with the recording named in its text."""
    named = type(error)(f"{label}: {error}")
    named.__dict__.update(error.__dict__)  # time_s and notes
    return named


def _track_or_raise(result: Track | Failure) -> Track:
    if isinstance(result, Track):
        return result
    raise result
