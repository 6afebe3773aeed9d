"""The table of README.md: errors and bands where the model is right and where it is wrong.

Each recording is tracked with what a user would know: the model's or the file's nominal lengths, and nominal mounts.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from oarlock import Calibration, Recording, Track
from oarlock.report.text import percent
from oarlock.rowing import FieldEffects, simulate_field
from oarlock.storage.arrays import Floats

from .record import Record, made_text
from .recordings import at_rate, read_simulated
from .sculling import errors
from .sections import table

RECORDINGS = "recordings"
SLOW_HZ = 50.0
CALIBRATED_ON_S = 20.0
GOOD_RADIO = {
    "clock_offset_s": 0.0,
    "clock_drift": 0.0,
    "clock_jitter_s": 0.0,
    "packet_loss": 0.0,
    "gap_s": 0.0,
}
ROUGH = replace(FieldEffects(), noise_factor=3.0, **GOOD_RADIO)
"""`careful` with three times the noise, synchronous."""

README_ROWS = ("exact", "exact_50_hz", "misfit_0", "misfit_0_calibrated", "wild_0", "wild_7")


@dataclass(frozen=True, eq=False)
class StatusTrial:
    """A recording with what a user knows, and with the truth.

    Args:
        recording: readings of all sensors.
        nominal: the lengths and mounts that a user knows; None for those of the model.
        truth: joint values.
        true_s: times of the positions.
        true_m: frame -> true positions, m.
    """

    recording: Recording
    nominal: Calibration | None
    truth: Track
    true_s: Floats
    true_m: Mapping[str, Floats]


Make = Callable[[], StatusTrial]
"""Gives a trial when it is needed."""


@dataclass(frozen=True)
class StatusRow:
    """One line of the tables: its trials, and how they are tracked."""

    key: str
    label: str
    trials: Sequence[Make]
    how: str = "filtered"  # or "calibrated" on the first seconds and scored on the rest


def rows(folder: Path | None) -> Iterator[StatusRow]:
    """All lines; without the folder of recordings only those that need none."""
    if folder is not None:
        exact = partial(read_trial, folder / "exact_B-B_0.npz")
        yield StatusRow("exact", "exactly as modelled, with boat surge and biases", [exact])
        yield StatusRow("exact_50_hz", "the same at 50 Hz", [partial(_slower, exact)])
        misfit, wild, other = (
            partial(read_trial, folder / f"{n}.npz") for n in ("misfit_0", "wild_0", "wild_7")
        )
        yield StatusRow("misfit_0", "mounts 5 deg off, lengths 5 % off, boat rolling", [misfit])
        yield StatusRow(
            "misfit_0_calibrated",
            "the same, self-calibrated on 20 s and scored on the rest",
            [misfit],
            "calibrated",
        )
        yield StatusRow(
            "wild_0",
            "soft tissue, sliding shoulders, bending spine, slipping grip, three times the noise",
            [wild],
        )
        yield StatusRow("wild_7", "another one of these", [other])
    rigid = [partial(field_trial, FieldEffects.misfit(), seed) for seed in (1, 2, 3)]
    yield StatusRow("misfit", "field simulator, `misfit`, seeds 1 to 3", rigid)
    rough = [partial(field_trial, ROUGH, seed) for seed in (61, 62, 63)]
    yield StatusRow("rough", "field simulator, `careful` with three times the noise, seeds 61 to 63", rough)
    careful = [partial(field_trial, FieldEffects(), seed) for seed in (1, 2, 3)]
    yield StatusRow("careful", "field simulator, `careful`, seeds 1 to 3", careful)


def measured() -> dict[str, Any]:
    """Tracks all recordings and scores them."""
    folder = Path(os.environ.get("OARLOCK_DATA") or "absent") / RECORDINGS
    figures = {}
    for row in rows(folder if folder.is_dir() else None):
        figures[row.key] = _row(row)
        print(f"{row.key}: {figures[row.key]}", flush=True)
    return {"rows": figures}


def _row(row: StatusRow) -> dict[str, Any]:
    runs = [_run(make(), row.how) for make in row.trials]
    return {"label": row.label, "how": row.how, **{name: [run[name] for run in runs] for name in runs[0]}}


def _run(trial: StatusTrial, how: str) -> dict[str, float]:
    model = oarlock.load_model("sculler")
    nominal, recording = trial.nominal, trial.recording
    if how == "calibrated":
        nominal = oarlock.calibration.calibrate_motion(model, recording, nominal, end_s=CALIBRATED_ON_S)
        recording = recording.slice(start_s=CALIBRATED_ON_S)
    track = oarlock.track(model, recording, nominal)
    return asdict(errors(track, trial.truth, trial.true_s, trial.true_m))


def read_trial(file: Path) -> StatusTrial:
    """A recording of the other generator."""
    read = read_simulated(file, file.stem, oarlock.load_model("sculler"))
    return StatusTrial(read.recording, read.nominal, read.truth, read.truth.time_s, read.positions_m)


def _slower(make: Make) -> StatusTrial:
    trial = make()
    return replace(trial, recording=at_rate(trial.recording, SLOW_HZ))


def field_trial(effects: FieldEffects, seed: int) -> StatusTrial:
    """A session of the field simulator, of which a user knows the model's own lengths and mounts."""
    made = simulate_field(oarlock.load_model("sculler"), effects, seed=seed)
    places = dict(zip(made.markers.names, made.markers.position_m.transpose(1, 0, 2), strict=True))
    return StatusTrial(made.recording, None, made.truth, made.markers.time_s, places)


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of README.md."""
    made = f"{made_text(record)}; `make pages PAGES=status` measures it anew."
    rows = record["rows"]
    lines = [_line(rows[key]) for key in README_ROWS if key in rows]
    return {"README.md": {"status": f"{table(COLUMNS, lines)}\n\n{made}"}}


COLUMNS = (
    "recording",
    "11 angles, deg",
    "in band",
    "hands, deg",
    "in band",
    "positions, mm",
    "in band",
)


def _line(row: Mapping[str, Any]) -> list[str]:
    pairs = (("mean_deg", "coverage"), ("hands_deg", "hands_coverage"), ("places_mm", "places_coverage"))
    cells = [
        cell
        for error, share in pairs
        for cell in (_number(float(np.mean(row[error]))), percent(float(np.mean(row[share]))))
    ]
    return [row["label"], *cells]


def _number(value: float) -> str:
    return f"{value:.3f}" if value < 0.1 else f"{value:.2f}" if value < 10 else f"{value:.0f}"
