"""One 9-axis unit against optical orientation: inclination and heading."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from oarlock import Recording
from oarlock.formats.datasets.broad import BODY, read_broad, read_broad_reference
from oarlock.storage.arrays import Floats

from . import others, ours
from .estimate import OrientationEstimate, Outcome, attempt
from .limits import limits, punctual
from .results import Collected, Plot, SetResult
from .scores import attitude_error_rad, later, rmse_deg
from .worst_window import worst_of, worst_plot

FOLDER = "broad"
WINDOW_S = 10.0
PARTS = ("inclination", "heading", "total")

TITLE = "One unit with magnetometer (BROAD)"
TEXT = (
    "One 9-axis unit on a rigid body with optical markers, 286 Hz: rotations, translations, tapping, and a magnet "
    "beside the path. Scored on the samples that the authors mark as movement, root mean square: inclination, heading "
    "once its circular mean difference is removed, and both together. The published figures are of the authors' search "
    "over parameters, with one setting for all 39 trials, and compare headings as they are."
)
LIMITS_TEXT = "How late the optical stamps are (negative: early). The authors have aligned the axes already."


def run(data_folder: Path) -> SetResult:
    """Score all trials that are there."""
    files = sorted((data_folder / FOLDER).glob("[0-9][0-9]_*.mat"))
    if not files:
        return SetResult(FOLDER, TITLE, TEXT, absent=f"no trial in {FOLDER}/")
    plain, removed = ({part: Collected() for part in PARTS} for _ in range(2))
    collected_limits = Collected()
    plots = [_trial(file, plain, removed, collected_limits) for file in files]
    for name, published in _published(data_folder / FOLDER).items():
        for part, collected in plain.items():
            figures = {
                _short(f.stem): published[f.stem][f"{part}_rmse_deg"] for f in files if f.stem in published
            }
            collected.put(name, figures, "figures of the authors, not run here")
    tables = [c.table(f"{part.capitalize()}, RMSE over the movement", mean=True) for part, c in plain.items()]
    tables.append(removed["total"].table("Total, RMSE over the movement, lag and delays removed", mean=True))
    tables.append(collected_limits.table("Limits of the reference", unit="", text=LIMITS_TEXT))
    return SetResult(FOLDER, TITLE, TEXT, tuple(tables), worst_of(plots))


def _trial(
    file: Path, plain: dict[str, Collected], removed: dict[str, Collected], collected_limits: Collected
) -> tuple[float, Plot | None]:
    """Fills the tables; gives the worst stretch."""
    recording, reference = read_broad(file), read_broad_reference(file)
    lag_s = limits(recording, reference).lag_s
    collected_limits.put(_short(file.stem), {"lag, ms": lag_s * 1e3})
    errors: dict[str, tuple[OrientationEstimate, Floats]] = {}
    for outcome in _outcomes(recording):
        for collected, compared in ((plain, reference), (removed, later(reference, lag_s))):
            parts: tuple[Floats, ...] = ()
            if isinstance(outcome, OrientationEstimate):
                estimate = punctual(recording, outcome) if collected is removed else outcome
                parts = attitude_error_rad(estimate, compared, BODY)
            for part in PARTS:
                figures = {
                    _short(file.stem): rmse_deg(e, reference.scored)
                    for p, e in zip(PARTS, parts, strict=False)
                    if p == part
                }
                collected[part].add(outcome, figures)
            if parts and isinstance(outcome, OrientationEstimate):
                errors[outcome.name] = outcome, np.degrees(parts[-1])  # those of the last reference stay
    caption = f"{_short(file.stem)}, total error, lag and delays removed"
    return worst_plot(
        f"broad-{file.stem[:2]}", caption, errors, reference.time_s - lag_s, reference.scored, WINDOW_S
    )


def _outcomes(recording: Recording) -> list[Outcome]:
    rows = others.at_rows(recording)
    return [
        *attempt(ours.NAMES, lambda: ours.track_broad(recording)),
        *attempt(others.VQF_NAMES, lambda: others.vqf(rows)),
        *attempt(others.IMUFUSION_NAMES, lambda: others.imufusion(rows)),
    ]


def _short(stem: str) -> str:
    """`01_undisturbed_slow_rotation_A` -> `slow rotation A`."""
    return stem[3:].removeprefix("undisturbed_").removeprefix("disturbed_").replace("_", " ")


def _published(folder: Path) -> dict[str, Mapping[str, Mapping[str, float]]]:
    """Software -> trial -> its RMSE with the setting that is best for all trials, if the files are there."""
    figures: dict[str, Mapping[str, Mapping[str, float]]] = {}
    for name in ("Madgwick", "Mahony"):
        file = folder / f"published_results_{name.lower()}_average_rmse.json"
        if file.is_file():
            trials = json.loads(file.read_text(encoding="utf-8"))["trials"]
            figures[f"{name} (published)"] = {trial: v["tagp_parameters"] for trial, v in trials.items()}
    return figures
