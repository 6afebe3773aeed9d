"""`compare` and `Comparison`: several estimators on the same recording, with errors and processor times."""

from __future__ import annotations

import csv
import io
import math
import platform
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from oarlock import _core
from oarlock.evaluation.comparison.estimators import Estimator, estimator, usual_estimators
from oarlock.evaluation.comparison.scores import Score, best, chosen_joints, row_of, score
from oarlock.evaluation.evaluate import evaluate
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.recording import Recording
from oarlock.storage.csv_cells import inert
from oarlock.storage.errors import DataError, DivergedError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.notebook_html import card, folded, html_table
from oarlock.storage.progress import Told, display
from oarlock.storage.toml import write_toml
from oarlock.storage.write_file import write_file
from oarlock.tracking.known_streams import known_streams
from oarlock.tracking.track import Track
from oarlock.tracking.tracking import admit

if TYPE_CHECKING:
    from oarlock._core import Model

FORMAT: Final = 1
Displays = bool | Callable[[str], AbstractContextManager[Told]] | None


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`.

    Args:
        scores: one row for each estimator, in the order requested.
        left_out: estimator -> reason why it could not run.
        joints: joints whose errors are averaged.
        reference: "truth", or without ground truth the estimator with which the others are compared.
        start_s: time at the beginning that is not scored, s.
        model: the model's name.
        processor: processor on which the times were measured.
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
        """Names of the columns that contain a number."""
        names = dict.fromkeys(name for row in self.scores for name in row.columns())
        return tuple(
            n for n in names if any(math.isfinite(r.columns().get(n, math.nan)) for r in self.scores)
        )

    @property
    def wins(self) -> dict[str, tuple[str, ...]]:
        """Column -> the best estimators in it, and those that are equal within `LEVEL`."""
        found = {}
        for name in self.columns:
            found[name] = best(name, {r.name: r.columns().get(name, math.nan) for r in self.scores})
        return {name: who for name, who in found.items() if who and name != "kinematics_us"}

    def to_dict(self) -> dict[str, Any]:
        """Plain data, in SI unless the key names another unit; NaN where there is no value."""
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

    def _repr_html_(self) -> str:
        lines = [(name, reason) for name, reason in self.left_out.items()]
        left_out = html_table(["estimator", "reason"], lines) if lines else ""
        header = ["estimator", *self.columns]
        rows = [(one.name, *(one.columns().get(name) for name in self.columns)) for one in self.scores]
        return card(
            "Comparison",
            f"against {self.reference}",
            html_table(header, rows),
            folded("Left out", left_out),
        )

    def save(self, folder: str | PathLike[str]) -> None:
        """Write compare.toml (all scores) and compare.csv (the table) into a folder."""
        with replaced_folder(folder, "comparison") as place:
            write_toml(place / "compare.toml", _writable(self.to_dict()))
            write_file(place / "compare.csv", self._csv())

    def _csv(self) -> str:
        text = io.StringIO(newline="")
        table = csv.writer(text, lineterminator="\n")
        table.writerow(["filter", "family", *(inert(name) for name in self.columns)])
        for row in self.scores:
            values = row.columns()
            numbers = [values.get(name, math.nan) for name in self.columns]
            named = [inert(row.name), inert(row.estimator.family)]
            table.writerow([*named, *(v if math.isfinite(v) else "" for v in numbers)])
        return text.getvalue()


def _writable(value: Any) -> Any:
    """Removes None, because TOML has no null."""
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
    progress: Displays = None,
) -> Comparison:
    """Run estimators on the same recording and score each.

    Times are those of the filter alone, per instant and for all of its sensors: of the engine's run, or of the loop or
    batch call of a single unit's filter. They exclude reading, checks, scores and, for single units, inverse
    kinematics. They are processor times of the thread, which depend less on the load of the machine than wall-clock
    times. The shortest of several repeats counts.

    Args:
        model: the body and its sensors.
        recording: measured streams.
        truth: ground truth to score against; None compares all with the first estimator that runs.
        estimators: names, or `Estimator`; None is the default selection. Estimators of the default selection that
            cannot run are left out, and the reason is reported.
        calibration: calibration of this session, used by all estimators.
        start_s: time at the beginning that is not scored, s.
        repeats: number of runs of each estimator.
        progress: True shows a bar or lines for each estimator. A function of its name returns a context manager, which
            gives what is called with the share done.

    Raises:
        DataError: a requested estimator cannot run, none can, or ground truth and recording do not overlap.
    """
    asked, shows = estimators is not None, display if progress is True else progress or None
    chosen = [estimator(e) if isinstance(e, str) else e for e in (estimators or usual_estimators())]
    if repeats < 1:
        raise DataError(f"compare: repeats = {repeats}; expected 1 or more")
    scores: list[Score] = []
    left_out: dict[str, str] = {}
    joints = chosen_joints(model)
    # The recording is checked here, so that the time of the check does not count for the first estimator.
    recording, _ = known_streams(model, recording)
    admit(model, corrected(recording, calibration))
    reference, name = truth, "truth"
    for one in chosen:
        try:
            with shows(one.name) if shows is not None else nullcontext(None) as share_done:
                track, step_us, kinematics_us = _timed(
                    one, model, recording, calibration, repeats, share_done
                )
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
        first = next(iter(left_out.items()), ("", "none was requested"))
        raise DataError(f"compare: no estimator can run on this recording. {first[0]}: {first[1]}")
    return Comparison(tuple(scores), left_out, joints, name, start_s, model.name, processor())


def _timed(
    one: Estimator,
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    repeats: int,
    progress: Told | None,
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


def processor() -> str:
    """Name of this machine's processor."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"
