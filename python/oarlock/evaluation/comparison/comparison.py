"""`compare` and `Comparison`: several estimators on the same recording, with errors and processor times."""

from __future__ import annotations

import csv
import math
import platform
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from oarlock import _core
from oarlock.evaluation.comparison.estimators import Estimator, estimator, usual_estimators
from oarlock.evaluation.comparison.scores import Score, best, chosen_joints, row_of, score
from oarlock.evaluation.evaluate import evaluate
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError, DivergedError
from oarlock.storage.toml import write_toml
from oarlock.tracking.track import Track
from oarlock.tracking.tracking import admit

if TYPE_CHECKING:
    from oarlock._core import Model

FORMAT: Final = 1
Told = Callable[[str], AbstractContextManager[Callable[[float], None]]]


@dataclass(frozen=True)
class Comparison:
    """What `compare` found.

    Args:
        scores: one row per estimator, in the order in which they were asked for.
        left_out: estimator -> why it could not run.
        joints: those whose errors are averaged.
        reference: "truth", or the estimator that the others are held against where there is no truth.
        start_s: seconds that were left out at the beginning.
        model: the model's name.
        processor: what the times were measured on.
    """

    scores: tuple[Score, ...]
    left_out: Mapping[str, str]
    joints: tuple[str, ...]
    reference: str
    start_s: float
    model: str
    processor: str

    def __getitem__(self, name: str) -> Score:
        for row in self.scores:
            if row.name == name:
                return row
        why = self.left_out.get(name)
        there = ", ".join(row.name for row in self.scores)
        raise KeyError(
            f"'{name}' was left out: {why}" if why else f"no '{name}' was compared; there are {there}"
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that hold any number."""
        names = dict.fromkeys(name for row in self.scores for name in row.columns())
        return tuple(
            n for n in names if any(math.isfinite(r.columns().get(n, math.nan)) for r in self.scores)
        )

    @property
    def wins(self) -> dict[str, tuple[str, ...]]:
        """Column -> the estimators that are best in it: the first, and those that are level with it."""
        found = {}
        for name in self.columns:
            found[name] = best(name, {r.name: r.columns().get(name, math.nan) for r in self.scores})
        return {name: who for name, who in found.items() if who and name != "kinematics_us"}

    def to_dict(self) -> dict[str, Any]:
        """Plain data, SI but where a key says otherwise; NaN where there is nothing to tell."""
        return {
            "format": FORMAT,
            "oarlock": _core.__version__,
            "model": self.model,
            "reference": self.reference,
            "start_s": self.start_s,
            "joints": list(self.joints),
            "processor": self.processor,
            "wins": {name: list(who) for name, who in self.wins.items()},
            "left_out": dict(self.left_out),
            "estimators": [row_of(row) for row in self.scores],
        }

    def save(self, folder: str | PathLike[str]) -> None:
        """Write compare.toml (all scores) and compare.csv (the table) into a folder."""
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        write_toml(place / "compare.toml", _writable(self.to_dict()))
        with open(place / "compare.csv", "w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["filter", "family", *self.columns])
            for row in self.scores:
                values = row.columns()
                numbers = [values.get(name, math.nan) for name in self.columns]
                table.writerow(
                    [row.name, row.estimator.family, *(v if math.isfinite(v) else "" for v in numbers)]
                )


def _writable(value: Any) -> Any:
    """Without what is None, which TOML has no word for."""
    if isinstance(value, Mapping):
        return {k: _writable(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple):
        return [math.nan if v is None else _writable(v) for v in value]
    return value


def compare(
    model: Model,
    recording: Recording,
    truth: Track | None = None,
    estimators: Iterable[str | Estimator] | None = None,
    *,
    calibration: Calibration | None = None,
    start_s: float = 2.0,
    repeats: int = 1,
    told: Told | None = None,
) -> Comparison:
    """Run estimators on the same recording and score each.

    Times are those of the filter alone, for all of its sensors and one instant: around the engine's run, or around
    the loop or batch call of a single unit's filter; reading, checks, scores and, of single units, the inverse
    kinematics are not in them. They are processor time of the thread, which neighbours on a busy machine disturb less
    than the clock on the wall; of several repeats the shortest.

    Args:
        model: the body and its sensors.
        recording: measured streams.
        truth: what to score against; None holds all against the first estimator that runs.
        estimators: names, or `Estimator`; None is the usual choice, of which those that cannot run here are left out
            with the reason.
        calibration: of this wearing, given to all.
        start_s: seconds at the beginning that are not scored.
        repeats: how often each runs.
        told: makes a context around each estimator, to show what is under way.

    Raises:
        DataError: an estimator that was named cannot run, none can, or truth and recording do not overlap.
    """
    asked = estimators is not None
    chosen = [estimator(e) if isinstance(e, str) else e for e in (estimators or usual_estimators())]
    if repeats < 1:
        raise DataError(f"compare: repeats = {repeats}; expected 1 or more")
    scores: list[Score] = []
    left_out: dict[str, str] = {}
    joints = chosen_joints(model)
    # what is odd about a recording is looked for once, not in the time of the first estimator
    admit(model, corrected(recording, calibration))
    reference, name = truth, "truth"
    for one in chosen:
        try:
            with told(one.name) if told is not None else nullcontext(None) as progress:
                track, step_us, kinematics_us = _timed(one, model, recording, calibration, repeats, progress)
        except (DataError, DivergedError) as error:
            if asked:
                raise
            left_out[one.name] = str(error)
            continue
        if reference is None:
            reference, name = track, one.name
        found = evaluate(track, reference, start_s=start_s)
        scores.append(score(one, found, joints, step_us, kinematics_us, track.notes))
    if not scores:
        first = next(iter(left_out.items()), ("", "none was asked for"))
        raise DataError(f"compare: no estimator can run on this recording. {first[0]}: {first[1]}")
    return Comparison(tuple(scores), left_out, joints, name, start_s, model.name, _processor())


def _timed(
    one: Estimator,
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    repeats: int,
    progress: Callable[[float], object] | None,
) -> tuple[Track, float, float]:
    """A track, and the shortest time of the filter and of the inverse kinematics for one instant, microseconds."""
    times = []
    for _ in range(repeats):
        began_s = time.thread_time()
        track = one.track(model, recording, calibration, progress=progress)
        spent_s, made = time.thread_time() - began_s, track.provenance
        times.append((made.get("filter_cpu_s", spent_s), made.get("kinematics_cpu_s", math.nan)))
    shortest = np.min(np.array(times), axis=0) * 1e6 / track.provenance["steps"]
    return track, float(shortest[0]), float(shortest[1])


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"
