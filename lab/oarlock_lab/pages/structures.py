"""The table of docs/bands.md that compares both structures on rowers: errors and bands, live and smoothed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

import oarlock
from oarlock import Config
from oarlock.rowing import FieldEffects
from oarlock.tracking.joint_series import HingeSeries

from .record import Record, made_text
from .sculling import ELEVEN, HANDS, SETTLED_S, angles
from .sections import table
from .status import RECORDINGS, Make, StatusTrial, field_trial, read_trial

STRUCTURES: Final = ("tree", "strapdown")
SEEDS = (1, 2, 3)


def rows(folder: Path) -> Mapping[str, Sequence[Make]]:
    """Trials of each line; recordings that are absent are left out."""
    files = {name: folder / f"{name}.npz" for name in ("exact_B-B_0", "misfit_0", "wild_0", "wild_7")}
    read = {name: [partial(read_trial, file)] for name, file in files.items() if file.is_file()}
    presets = {"misfit": FieldEffects.misfit(), "careful": FieldEffects(), "wild": FieldEffects.wild()}
    drawn = {
        f"field simulator, `{name}`, seeds 1 to 3": [partial(field_trial, effects, seed) for seed in SEEDS]
        for name, effects in presets.items()
    }
    return {**read, **drawn}


def measured() -> dict[str, Any]:
    """Tracks all recordings in both structures and scores them."""
    folder = Path(os.environ.get("OARLOCK_DATA") or "absent") / RECORDINGS
    figures: dict[str, Any] = {}
    for label, trials in rows(folder).items():
        for structure in STRUCTURES:
            scores = [_scores(make(), structure) for make in trials]
            line = {key: [score[key] for score in scores] for key in scores[0]}
            figures[f"{label}: {structure}"] = {"label": label, "structure": structure, **line}
            print(f"{label}, {structure}: {line}", flush=True)
    return {"rows": figures}


def _scores(trial: StatusTrial, structure: Literal["strapdown", "tree"]) -> dict[str, float]:
    config = Config(structure=structure)
    live = oarlock.track(oarlock.load_model("sculler"), trial.recording, trial.nominal, config)
    rows_by_structure: dict[str, float] = {}
    for when, track in (("live", live), ("smoothed", oarlock.smooth(live))):
        scores = angles(track, trial.truth)
        rows_by_structure |= {
            f"{when}_deg": scores.mean_rmse_deg(ELEVEN),
            f"{when}_hands_deg": scores.mean_rmse_deg(HANDS),
            f"{when}_coverage": scores.mean_coverage(ELEVEN),
            f"{when}_least_coverage": min(scores.mean_coverage([joint]) for joint in ELEVEN),
            f"{when}_hands_coverage": scores.mean_coverage(HANDS),
            f"{when}_e2_over_var": _e2_over_var(track, trial.truth),
        }
    return rows_by_structure


def _e2_over_var(track: oarlock.Track, truth: oarlock.Track) -> float:
    """Mean of the squared errors over their variances; 1 if bands are honest."""
    late = track.time_s >= track.time_s[0] + SETTLED_S
    ratios = []
    for joint in ELEVEN:
        ours, true_series = track[joint], truth[joint]
        assert isinstance(ours, HingeSeries) and isinstance(true_series, HingeSeries)
        true = np.interp(track.time_s[late], truth.time_s, true_series.angle_rad)
        error = np.remainder(ours.angle_rad[late] - true + np.pi, 2 * np.pi) - np.pi
        ratios.append(np.mean((error / ours.std_rad[late]) ** 2))
    return float(np.mean(ratios))


FIGURES = {"11 angles, deg": "deg", "in band, %": "coverage", "least joint, %": "least_coverage"}
COLUMNS = ("recording", *(f"{title}: {structure}" for title in FIGURES for structure in STRUCTURES))


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of docs/bands.md; each cell is live / smoothed."""
    rows_by_structure = record["rows"]
    lines = [
        _line(label, rows_by_structure)
        for label in dict.fromkeys(row["label"] for row in rows_by_structure.values())
    ]
    made = f"{made_text(record)}; `make pages PAGES=structures` measures it anew."
    return {"docs/bands.md": {"structures": f"{table(COLUMNS, lines)}\n\n{made}"}}


def _line(label: str, rows: Mapping[str, Any]) -> list[str]:
    pairs = [
        _pair(rows[f"{label}: {structure}"], key) for key in FIGURES.values() for structure in STRUCTURES
    ]
    return [label, *pairs]


def _pair(row: Mapping[str, Any], key: str) -> str:
    values = [row[f"{when}_{key}"] for when in ("live", "smoothed")]
    if key == "deg":
        return " / ".join(f"{np.mean(series):.2f}" for series in values)
    return " / ".join(f"{100.0 * (min if 'least' in key else np.mean)(series):.1f}" for series in values)
