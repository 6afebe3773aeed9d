"""Misfit of a model to one second of readings, from a filter that expects the usual errors of real recordings."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock import _core
from oarlock.evaluation.suspects.suspect import USUAL
from oarlock.model.edit import document_of, model_of
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream

if TYPE_CHECKING:
    from oarlock._core import Model, Run
    from oarlock.recording.calibration import Calibration

# Errors of readings from mounts 5 deg off, lengths 5 % off, soft tissue and nearby iron, not the noise at rest.
GYRO_STD_RAD_S = 0.15
ACCEL_STD_M_S2 = 1.0
MAG_STD_UT = 6.0
HINGE_STD_RAD = 0.02
PLACE_STD_M = 0.02
CLOSURE_STD_AXIS = 0.1
# A second may begin in full motion, and is too short to learn the process noise.
RATES_WIDER, DRIVEN_HARDER = 6.0, 5.0
START_WINDOWS_S = (0.1, 0.25, 0.04)
# In the first selection of faults the noise is so large that the start fit converges quickly for every hypothesis.
PRESELECTION_NOISE = 4.0


@dataclass(frozen=True)
class Misfit:
    """Squared innovations relative to their expected value: the mean of all readings, and by sensor.

    `posture` is the start posture, rad and m.
    """

    total: float
    by_source: Mapping[str, float]
    posture: tuple[float, ...] = ()


LOST = Misfit(float("inf"), {})
AT_ONCE = 4
"""Recordings that are tracked between two looks at the clock."""


class Spent(Exception):
    """The time of a search is over."""


class MisfitEvaluator:
    """Tracks short recordings of one model in parallel and computes the misfit of each."""

    def __init__(
        self,
        model: Model,
        calibration: Calibration | None,
        closures: bool = True,
        end_s: float = float("inf"),
    ) -> None:
        described = model.describe()
        self._model, self._rough = (coarse(model, noise) for noise in (1.0, PRESELECTION_NOISE))
        self._calibration = calibration
        self._closures, self._end_s = closures, end_s
        self._bases = [base.name for base in described.base_acceleration]
        self._units = {s.name for s in described.inertial_units}

    def misfits(self, recordings: Sequence[Recording]) -> list[Misfit]:
        """Misfit of each recording; if it is large, a longer start window is tried."""
        found = self._tracked(self._model, recordings, START_WINDOWS_S[0])
        for window_s in START_WINDOWS_S[1:]:
            bad = [i for i, fit in enumerate(found) if fit.total > USUAL]
            again = self._tracked(self._model, [recordings[i] for i in bad], window_s)
            for i, fit in zip(bad, again, strict=True):
                found[i] = min(found[i], fit, key=lambda one: one.total)
        return found

    def preselected(self, recordings: Sequence[Recording]) -> list[Misfit]:
        """As `misfits`, faster and less accurate; only for comparison with each other."""
        return self._tracked(self._rough, recordings, START_WINDOWS_S[0])

    def misfit(self, recording: Recording) -> Misfit:
        """Misfit of one recording."""
        return self.misfits([recording])[0]

    def misfits_from(self, recordings: Sequence[Recording], posture: tuple[float, ...]) -> list[Misfit]:
        """Misfit of each recording, started near this posture."""
        return self._tracked(self._model, recordings, START_WINDOWS_S[0], posture)

    def _tracked(
        self, model: Model, recordings: Sequence[Recording], window_s: float, posture: tuple[float, ...] = ()
    ) -> list[Misfit]:
        config = self._config(window_s, posture)
        jobs = [(recording, self._calibration, config) for recording in recordings]
        runs = []
        for first in range(0, len(jobs), AT_ONCE):
            if time.monotonic() > self._end_s:
                raise Spent
            runs += _core.track_many(model, jobs[first : first + AT_ONCE], False, None, None)
        return [self._misfit(run[0]) if isinstance(run, tuple) else LOST for run in runs]

    def _config(self, window_s: float, posture: tuple[float, ...]) -> _core.Config:
        return _core.Config(
            structure="tree",
            estimate=self._bases,
            closures=self._closures,
            magnetometer="on",
            filter="ekf",
            gate=False,
            start_window_s=window_s,
            initial_q=list(posture) or None,
        )

    def _misfit(self, run: Run) -> Misfit:
        infos = run.infos()
        nis, used = np.nan_to_num(infos["nis"]).sum(axis=0), infos["used"].sum(axis=0)
        alone = np.array([name not in self._units for name in run.source_names], dtype=bool)
        total = np.nansum(infos["inertial_nis"]) + nis[alone].sum()
        rows = infos["inertial_used"].sum() + used[alone].sum()
        each = zip(run.source_names, nis, used, strict=True)
        by_source = {name: float(n / u) for name, n, u in each if u}
        mean = float(total / rows) if rows and np.isfinite(total) else float("inf")
        return Misfit(mean, by_source, self._posture(run))

    def _posture(self, run: Run) -> tuple[float, ...]:
        columns = {name: i for i, name in enumerate(run.state_names)}
        states = run.states([columns.get(name) for name in self._model.coordinate_names], False)
        return tuple(float(x) for x in np.nan_to_num(states[0])) if len(states) else ()


def without_magnetometers(recording: Recording, names: Sequence[str]) -> Recording | None:
    """The recording without the magnetometers of these units; None if nothing else is left."""
    kept: list[Stream] = []
    for stream in recording.streams:
        if not isinstance(stream, ImuStream) or stream.name not in names:
            kept.append(stream)
        elif stream.gyro_rad_s is not None or stream.accel_m_s2 is not None:
            kept.append(replace(stream, mag_ut=None))
    return Recording(kept) if kept else None


def has_magnetometers(recording: Recording) -> bool:
    """Whether any unit has a magnetometer."""
    return any(isinstance(s, ImuStream) and s.mag_ut is not None for s in recording.streams)


@lru_cache(maxsize=8)
def coarse(model: Model, noise: float) -> Model:
    """The model with the reading errors of real recordings, times `noise`, and a start that may be in motion."""
    document = document_of(model)
    slides = {joint["name"] for joint in document.get("joint", ()) if joint.get("kind") == "slide"}
    for sensor in document.get("sensor", ()):
        _widen(sensor, "gyro_std_rad_s", noise * GYRO_STD_RAD_S)
        _widen(sensor, "accel_std_m_s2", noise * ACCEL_STD_M_S2)
        _widen(sensor, "mag_std_ut", noise * MAG_STD_UT)
        _widen(sensor, "std", noise * (PLACE_STD_M if sensor.get("joint") in slides else HINGE_STD_RAD))
        _widen(sensor, "std_m", noise * PLACE_STD_M)
    for closure in document.get("closure", ()):
        _widen(closure, "std_m", noise * PLACE_STD_M)
        _widen(closure, "std_axis", noise * CLOSURE_STD_AXIS)
    processes = list(document.get("process", {}).values())
    processes += [
        joint[k] for joint in document.get("joint", ()) for k in ("process", "translation") if k in joint
    ]
    for process in processes:
        _free(process)
    return model_of(document, model)


def _widen(table: dict[str, Any], key: str, least: float) -> None:
    if key in table:
        table[key] = max(table[key], least) if isinstance(table[key], int | float) else least


def _free(process: object) -> None:
    if not isinstance(process, dict):
        return
    if isinstance(process.get("density"), int | float):
        process["density"] *= DRIVEN_HARDER
    start = process.get("start_std")
    if isinstance(start, list) and len(start) == 3 and all(isinstance(x, int | float) for x in start):
        process["start_std"] = [start[0], start[1] * RATES_WIDER, start[2] * RATES_WIDER]
