"""The tables of coverage of docs/bands.md: whether 95 % bands hold, joint by joint, simulated and against optics.

A band that holds covers 95 % of the truth and has a NEES near 1. Simulated sets are tracked with what a user would
know: the model's nominal lengths and mounts. Hands are scored like all other joints.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from oarlock import Recording, Track
from oarlock.evaluation.reference import Reference
from oarlock.formats.datasets.dfjimu import BODIES, read_dfjimu, read_dfjimu_reference
from oarlock.formats.datasets.diodem import read_diodem, read_diodem_reference
from oarlock.model.coordinates import joint_columns
from oarlock.report.text import percent
from oarlock.rowing import FieldEffects
from oarlock.storage.arrays import Floats, Indices
from oarlock.storage.statistics import NORMAL_95
from oarlock_lab.validation import dfjimu, diodem, ours
from oarlock_lab.validation.estimate import OrientationEstimate
from oarlock_lab.validation.limits import limits, punctual
from oarlock_lab.validation.scores import hinge_error_rad, later, relative_error_parts_rad

from .record import Record, made_text
from .sculling import ELEVEN, HANDS, angles
from .sections import table
from .status import CALIBRATED_ON_S, ROUGH, StatusTrial, field_trial

SEEDS = range(101, 111)
"""Not used in the development of the bands."""
JOINTS = ELEVEN + HANDS
HOW = ("live", "smoothed")

Joints = dict[str, dict[str, float]]
"""Joint -> `rmse_deg`, `coverage`, `nees`, and the share of rows where it is `observed`."""


@dataclass(frozen=True)
class Set:
    """Recordings of one kind, and how the live and the smoothed track of each are scored."""

    key: str
    label: str
    runs: Sequence[Callable[[], dict[str, Joints]]]


def sets(data: Path | None, seeds: Sequence[int]) -> Iterator[Set]:
    """All sets; without the folder of public recordings only the simulated ones."""
    simulated = (
        ("exact", "as modelled", FieldEffects.off(), False),
        ("misfit", "`misfit`", FieldEffects.misfit(), False),
        ("calibrated", "`misfit`, self-calibrated on 20 s", FieldEffects.misfit(), True),
        ("wild", "`careful` with three times the noise", ROUGH, False),
    )
    for key, label, effects, calibrated in simulated:
        yield Set(key, label, [partial(_sculled, effects, seed, calibrated) for seed in seeds])
    if data is not None:
        for removed, suffix, words in (
            (False, "", ""),
            (True, "_removed", "; lag and cluster rotations removed"),
        ):
            two, chain = ([partial(run, f, removed) for f in files] for run, files in _optical(data))
            yield Set(f"dfjimu{suffix}", f"two units beside a ball joint{words}", two)
            yield Set(f"diodem{suffix}", f"chain of five links, units screwed on{words}", chain)


def _optical(data: Path) -> tuple[tuple[Callable[..., dict[str, Joints]], list[Path]], ...]:
    trials = sorted((data / dfjimu.FOLDER).glob("data_*.mat"))
    chains = sorted(file.parent for file in (data / diodem.FOLDER).glob("*/omc.csv"))
    return (_two_units, trials), (_chain, chains)


def measured(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Tracks all recordings and scores their bands."""
    data = Path(os.environ.get("OARLOCK_DATA") or "absent") / "data"
    figures = {}
    for recording_set in sets(data if data.is_dir() else None, seeds):
        runs = [run() for run in recording_set.runs]
        figures[recording_set.key] = {"label": recording_set.label, "recordings": len(runs), **_pooled(runs)}
        print(text(recording_set.key, figures[recording_set.key]), flush=True)
    return {"sets": figures}


def _pooled(runs: Sequence[Mapping[str, Joints]]) -> dict[str, Joints]:
    """Means over recordings; RMSE by its square."""
    pooled: dict[str, Joints] = {}
    for how in runs[0]:
        pooled[how] = {}
        for joint in runs[0][how]:
            scores = [run[how][joint] for run in runs]
            values = {name: np.array([score[name] for score in scores]) for name in scores[0]}
            rmse = float(np.sqrt(np.nanmean(values["rmse_deg"] ** 2)))
            pooled[how][joint] = {
                "rmse_deg": rmse,
                **{name: float(np.nanmean(values[name])) for name in ("coverage", "nees", "observed")},
            }
    return pooled


def text(key: str, figures: Mapping[str, Any]) -> str:
    """A table for the terminal."""
    lines = [f"{key}: {figures['recordings']} recordings"]
    for how in HOW:
        joints: Joints = figures[how]
        for name, score in joints.items():
            lines.append(
                f"  {how:8} {name:24} RMSE {score['rmse_deg']:7.2f} deg  coverage {100 * score['coverage']:5.1f} %"
                f"  NEES {score['nees']:8.2f}  observed {100 * score['observed']:5.1f} %"
            )
        lines.append(f"  {how:8} {_verdict(joints)}")
    return "\n".join(lines)


def _mean(joints: Joints, quantity: str) -> float:
    return float(np.mean([score[quantity] for score in joints.values()]))


def _verdict(joints: Joints) -> str:
    worst = min(joints, key=lambda name: joints[name]["coverage"])
    return (
        f"mean coverage {percent(_mean(joints, 'coverage'))}, mean NEES {_mean(joints, 'nees'):.2f}, "
        f"least {percent(joints[worst]['coverage'])} ({worst})"
    )


def _sculled(effects: FieldEffects, seed: int, calibrated: bool) -> dict[str, Joints]:
    trial = field_trial(effects, seed)
    model = oarlock.load_model("sculler")
    nominal, recording = trial.nominal, trial.recording
    if calibrated:
        nominal = oarlock.calibration.calibrate_motion(model, recording, nominal, end_s=CALIBRATED_ON_S)
        recording = recording.slice(start_s=CALIBRATED_ON_S)
    live = oarlock.track(model, recording, nominal)
    return {how: _scored(track, trial) for how, track in zip(HOW, (live, oarlock.smooth(live)), strict=True)}


def _scored(track: Track, trial: StatusTrial) -> Joints:
    scores = angles(track, trial.truth)
    observed = dict(zip(track.coordinate_names, track.observed.mean(axis=0), strict=True))
    return {
        name: {
            "rmse_deg": float(np.degrees(scores[name].rmse)),
            "coverage": scores[name].coverage,
            "nees": scores[name].nees,
            "observed": float(observed[name]),
        }
        for name in JOINTS
    }


def _two_units(file: Path, removed: bool) -> dict[str, Joints]:
    recording, reference = read_dfjimu(file), read_dfjimu_reference(file)
    joints = {"ball": Joint(BODIES)}
    tracks = ours.dfjimu_tracks(recording)
    return _against(recording, reference, tracks, joints, dfjimu.SCORED_AFTER_S, removed)


def _chain(folder: Path, removed: bool) -> dict[str, Joints]:
    recording = read_diodem(folder, "rigid", diodem.MAG_UNIT_UT)
    reference = later(read_diodem_reference(folder), diodem.TRIAL1_LAG_S)
    hinges = {name.replace(" ", "_"): Joint(*hinge) for name, hinge in diodem.HINGES.items()}
    joints = {"ball": Joint(diodem.BALL), **hinges}
    tracks = ours.diodem_tracks(recording)
    return _against(recording, reference, tracks, joints, diodem.SCORED_AFTER_S, removed)


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies of a reference; with the letter of its axis it is a hinge."""

    pair: tuple[str, str]
    axis: str = ""

    def error_rad(self, estimate: OrientationEstimate, reference: Reference) -> Floats:
        """Errors (T, 1) or, of a ball in the child's axes, (T, 3)."""
        if self.axis:
            return hinge_error_rad(estimate, reference, self.pair, self.axis)[:, None]
        return relative_error_parts_rad(estimate, reference, self.pair)


def _against(
    recording: Recording,
    reference: Reference,
    tracks: Iterator[tuple[OrientationEstimate, Track]],
    joints: Mapping[str, Joint],
    after_s: float,
    removed: bool,
) -> dict[str, Joints]:
    """Scores against optical orientations, with lag and cluster rotations removed or as the files stand."""
    if removed:
        reference = limits(recording, reference).removed_from(reference)
    compared = reference.time_s > after_s
    joints_by_name: dict[str, Joints] = {}
    for how, (plain, track) in zip(HOW, tracks, strict=True):
        estimate = punctual(recording, plain) if removed else plain
        rows = np.searchsorted(track.time_s[:-1], reference.time_s[compared])
        joints_by_name[how] = {
            name: _optical_score(track, name, rows, joint.error_rad(estimate, reference)[compared])
            for name, joint in joints.items()
        }
    return joints_by_name


def _optical_score(track: Track, name: str, rows: Indices, error: Floats) -> dict[str, float]:
    columns = list(joint_columns(track.coordinate_names)[name])
    std, there = track.q_std[rows][:, columns], np.isfinite(error).all(axis=1)
    ratio = error[there] / std[there]
    return {
        "rmse_deg": float(np.degrees(np.sqrt(np.mean(np.sum(error[there] ** 2, axis=1))))),
        "coverage": float(np.mean(np.abs(ratio) <= NORMAL_95)),
        "nees": float(np.mean(ratio**2)),
        "observed": float(np.mean(track.observed[:, columns])),
    }


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of docs/bands.md."""
    made = f"{made_text(record)}; `make pages PAGES=coverage` measures it anew."
    return {"docs/bands.md": {"coverage": f"{_summary(record['sets'])}\n\n{made}"}}


def _summary(joints: Mapping[str, Any]) -> str:
    header = ("recordings", "number", "in band, live", "NEES", "least", "smoothed", "NEES", "least")
    rows = [
        [entry["label"], entry["recordings"], *(cell for how in HOW for cell in _cells(entry[how]))]
        for entry in joints.values()
    ]
    return table(header, rows)


def _cells(joints: Joints) -> list[str]:
    worst = min(joints, key=lambda name: joints[name]["coverage"])
    share = percent(joints[worst]["coverage"])
    return [percent(_mean(joints, "coverage")), f"{_mean(joints, 'nees'):.2f}", f"{share} ({worst})"]
