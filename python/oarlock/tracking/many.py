"""Many recordings, or one motion under many seeds, tracked side by side: each as `track` alone would track it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, TypeAlias, TypeVar, overload

from oarlock import _core
from oarlock._core import Config, Model, Run
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.plausibility import Finding
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError, DivergedError, ModelError
from oarlock.tracking.track import Track
from oarlock.tracking.tracking import Progress, add_findings, admit, finished, require_recording

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
    progress: Progress | None = None,
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
    progress: Progress | None = None,
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
    progress: Progress | None = None,
) -> list[Track] | list[Track | Failure]:
    """Track recordings of one model on several cores; bit for bit what `track` gives for each alone.

    No result depends on the number of threads. A recording that fails does not stop the others.

    Args:
        model: the body and its sensors, the same for all.
        recordings: each a wearing, a trial or a seed of its own.
        calibration: one for all, or one (or None) for each recording.
        config: one for all, or one (or None) for each recording.
        smooth: smooth each track, as `oarlock.smooth` does; the filtered ones are not kept.
        threads: how many recordings are tracked at a time; None takes all cores.
        on_error: "raise" raises the first error, in the order of the recordings, once the others are done
            (at once where a recording is refused before any is tracked); "return" puts each error in the
            place of its track.
        progress: called now and then with the share of all work done, 0 to 1.

    Returns:
        Tracks in the order given. All are in memory at a time, each with its samples: track a season in parts.

    Raises:
        DataError: what is given does not fit together; or as `track`. The text names the recording's index and
            its source where that is known.
        DivergedError: as `track`.
    """
    given = _checked(model, recordings, threads, on_error)
    calibrations = _one_each(calibration, Calibration, "calibration", len(given))
    configs = [c if c is not None else Config() for c in _one_each(config, Config, "config", len(given))]
    labels = [_label(index, recording) for index, recording in enumerate(given)]
    jobs = dict(zip(labels, zip(given, calibrations, configs, strict=True), strict=True))
    stop = on_error == "raise"
    results = outcomes(model, jobs, smooth=smooth, threads=threads, stop_on_refusal=stop, progress=progress)
    return [_track_or_raise(result) for result in results] if stop else results


def outcomes(
    model: Model,
    jobs: Mapping[str, Job],
    *,
    smooth: bool,
    threads: int | None,
    stop_on_refusal: bool,
    progress: Progress | None,
) -> list[Track | Failure]:
    """What became of each job, in order; an error's text begins with the key of its job.

    Raises:
        DataError: `stop_on_refusal` is set and a recording is refused before any is tracked.
    """
    results: dict[str, Track | Failure] = {}
    findings: dict[str, list[Finding]] = {}
    for label, (recording, calibration, _) in jobs.items():
        try:
            require_recording(recording)
            findings[label] = admit(model, corrected(recording, calibration))
        except DataError as error:
            results[label] = refused = _named(error, label)
            if stop_on_refusal:
                raise refused from None
    runs = _core.track_many(model, [jobs[label] for label in findings], smooth, threads, progress)
    for (label, odd), run in zip(findings.items(), runs, strict=True):
        results[label] = _result(model, label, jobs[label], run, odd)
    return [results[label] for label in jobs]


def _label(index: int, recording: object) -> str:
    source = _source(recording) if isinstance(recording, Recording) else ""
    return f"recordings[{index}] ({source})" if source else f"recordings[{index}]"


def _source(recording: Recording) -> str:
    """Where a recording comes from, in a word or two; empty if it does not say."""
    source = recording.meta.get("source")
    if isinstance(source, Mapping):
        source = next((source[key] for key in ("file", "mapping", "run") if key in source), None)
    return source if isinstance(source, str) else ""


def _checked(model: object, recordings: object, threads: object, on_error: object) -> list[Recording]:
    if not isinstance(model, Model):
        raise DataError(
            f"track_many: expected one Model for all recordings, got {type(model).__name__}. "
            "Recordings of several models take one call for each model"
        )
    if isinstance(recordings, Recording) or not isinstance(recordings, Iterable):
        kind = type(recordings).__name__
        raise DataError(
            f"track_many: expected a list of recordings, got {kind}; oarlock.track takes a single one"
        )
    if on_error not in ("raise", "return"):
        raise DataError(f'track_many: on_error = {on_error!r}: expected "raise" or "return"')
    if threads is not None and (not isinstance(threads, int) or isinstance(threads, bool) or threads < 1):
        raise DataError(f"track_many: threads = {threads!r}: expected 1 or more, or None for all cores")
    return list(recordings)


def _one_each(
    given: _Part | Sequence[_Part | None] | None, kind: type[_Part], name: str, count: int
) -> list[_Part | None]:
    if given is None or isinstance(given, kind):
        return [given] * count
    each: list[_Part | None] = list(given) if isinstance(given, Sequence) else [given]
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


def _result(model: Model, label: str, job: Job, run: _Ended, findings: list[Finding]) -> Track | Failure:
    recording, calibration, config = job
    if not isinstance(run, tuple):
        if isinstance(run, DivergedError):
            add_findings(run, findings)
        return _named(run, label)
    done, notes, wall_s, smoothing_wall_s = run
    return finished(model, recording, calibration, config, done, notes, findings, wall_s, smoothing_wall_s)


def _named(error: _AnyFailure, label: str) -> _AnyFailure:
    """The same error, whose text says of which recording it is."""
    named = type(error)(f"{label}: {error}")
    named.__dict__.update(error.__dict__)  # time_s and notes
    return named


def _track_or_raise(result: Track | Failure) -> Track:
    if isinstance(result, Track):
        return result
    raise result
