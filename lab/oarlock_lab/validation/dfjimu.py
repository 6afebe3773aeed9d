"""Two units beside a ball joint, against optical orientations: relative orientation without magnetometer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import cast

import numpy as np

from oarlock import Recording
from oarlock.evaluation.reference import Reference
from oarlock.formats.datasets.dfjimu import BODIES, read_dfjimu, read_dfjimu_reference
from oarlock.storage.arrays import Floats

from . import others, ours
from .estimate import OrientationEstimate, Outcome, attempt
from .limits import limits, punctual
from .results import Collected, Plot, SetResult
from .scores import heading_zeroed, later, relative_error_rad, rmse_deg, turn_between_rad
from .worst_window import worst_of, worst_plot

FOLDER = "dfjimu"
TRIALS = ("1D_01", "2D_01", "3D_01", "3D_03", "3D_05")
SCORED_AFTER_S = 10.0
WINDOW_S = 10.0

AUTHORS_LAG_S = -0.02
"""The authors' script (tests/evaluate_package.py) compares a row of the reference with the estimate's next row."""

TITLE = "Two units beside a ball joint (dfjimu)"
TEXT = (
    "Two bodies joined by a ball joint, an inertial unit without magnetometer on each, 50 Hz; optical "
    "clusters on the units are the reference. Scored: the angle between estimated and optical relative "
    "orientation, root mean square over the samples after 10 s. The relative heading of the two units is "
    "not measured by anything but the joint itself."
)
PLAIN, AUTHORS, REMOVED = "as the files stand", "reference one row later", "limits and delays removed"
OWN = "each aligned as its authors do"
HEADED = tuple(f"{name}, heading given" for name in others.VQF_WITHOUT_MAG)
HOW = {
    OWN: "The reference is one row later for dfjimu, as its authors score it, and as the files stand for all others.",
    PLAIN: "",
    AUTHORS: "As the authors of the recordings score their own software: the reference is early by one row.",
    REMOVED: "Lag, drift and jumps of the reference, turns of its clusters and each software's delay are removed.",
}
LIMITS_TEXT = (
    "How late the optical stamps are (negative: early), how fast this changes, at how many samples it jumps, "
    "and how far each cluster is turned against its unit."
)


def run(data_folder: Path) -> SetResult:
    """Score all trials that are there."""
    files = {t: data_folder / FOLDER / f"data_{t}.mat" for t in TRIALS}
    there = {t: f for t, f in files.items() if f.is_file()}
    if not there:
        return SetResult(FOLDER, TITLE, TEXT, absent=f"no data_*.mat in {FOLDER}/")
    scored, collected_limits = {name: Collected() for name in HOW}, Collected()
    plots = [_trial(trial, file, scored, collected_limits) for trial, file in there.items()]
    tables = [
        collected.table(f"Relative orientation, RMSE after 10 s, {name}", mean=True, text=HOW[name])
        for name, collected in scored.items()
    ]
    tables.append(collected_limits.table("Limits of the reference", unit="", text=LIMITS_TEXT))
    absent = tuple(f"Trial {t} is absent." for t in TRIALS if t not in there)
    return SetResult(FOLDER, TITLE, TEXT, tuple(tables), worst_of(plots), absent)


def _trial(
    trial: str, file: Path, scored: dict[str, Collected], collected_limits: Collected
) -> tuple[float, Plot | None]:
    """Fills the tables; gives the worst stretch."""
    recording, plain = read_dfjimu(file), read_dfjimu_reference(file)
    reference_limits = limits(recording, plain)
    collected_limits.put(trial, reference_limits.figures)
    references = {
        PLAIN: plain,
        AUTHORS: later(plain, AUTHORS_LAG_S),
        REMOVED: reference_limits.removed_from(plain),
    }
    rows = plain.time_s > SCORED_AFTER_S
    errors: dict[str, tuple[OrientationEstimate, Floats]] = {}
    for outcome in _outcomes(recording, references[REMOVED]):
        for name in HOW:
            if not isinstance(outcome, OrientationEstimate):
                scored[name].add(outcome, {})
                continue
            reference = references[_alignment(outcome) if name == OWN else name]
            compared = punctual(recording, outcome) if name == REMOVED else outcome
            error = relative_error_rad(compared, reference, BODIES)
            scored[name].add(outcome, {trial: rmse_deg(error, rows)})
            errors[outcome.name] = outcome, np.degrees(error)  # those of the last reference stay
    angle = np.degrees(turn_between_rad(references[REMOVED], BODIES))
    caption = f"trial {trial}, {REMOVED}"
    truth = [("angle between the bodies, deg", angle)]
    return worst_plot(f"dfjimu-{trial}", caption, errors, references[REMOVED].time_s, rows, WINDOW_S, truth)


def _alignment(outcome: OrientationEstimate) -> str:
    """The alignment with which the authors of a software score it."""
    return AUTHORS if outcome.name in others.DFJIMU_NAMES else PLAIN


def _outcomes(recording: Recording, reference: Reference) -> list[Outcome]:
    joint = cast(dict[str, list[float]], recording.meta["joint_in_sensor_m"])
    rows = others.at_rows(recording)
    return [
        *attempt(ours.NAMES, lambda: ours.track_dfjimu(recording)),
        *attempt(ours.CALIBRATED_NAMES, lambda: ours.track_dfjimu_calibrated(recording)),
        *attempt(others.DFJIMU_NAMES, lambda: others.dfjimu(rows, joint)),
        *attempt(HEADED, lambda: _headed(rows, reference)),
    ]


def _headed(recording: Recording, reference: Reference) -> Iterator[OrientationEstimate]:
    """VQF knows no relative heading: it is given the right one at the moment where scoring begins."""
    for estimate in others.vqf(recording, others.VQF_WITHOUT_MAG):
        estimate_zeroed = heading_zeroed(estimate, reference, SCORED_AFTER_S)
        yield OrientationEstimate(
            f"{estimate.name}, heading given",
            estimate_zeroed.time_s,
            estimate_zeroed.quats,
            estimate_zeroed.online,
            estimate_zeroed.note,
        )
