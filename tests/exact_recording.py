"""Simulated sculling with its truth, ways to spoil it, and the figures by which tracking it is judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import oarlock
from local_data import local_folder
from oarlock.storage.arrays import Floats
from oarlock_lab.pages import recordings, sculling

Exact = recordings.SimulatedRecording
UNITS, ENCODERS = recordings.UNITS, recordings.ENCODERS
with_rows, at_rate = recordings.with_rows, recordings.at_rate
TREE = oarlock.Config(structure="tree")
STRUCTURES = ("tree", "strapdown")
SHOULDER, ARM, ELEVEN = sculling.SHOULDER, sculling.ARM, sculling.ELEVEN
RADIAL, PALMAR, HANDS, SETTLED_S = sculling.RADIAL, sculling.PALMAR, sculling.HANDS, sculling.SETTLED_S

EXCERPT = Path(__file__).parent / "data/exact_B-B_10s.npz"
TRUE_BIAS = {"S-NB": 0.0, "B-NB": 0.0, "S-B": 0.01, "B-B": 0.01}
"""rad/s and m/s2 on every axis of every unit."""


@cache
def sculler() -> oarlock.Model:
    return oarlock.load_model("sculler")


def oars_as_states(folder: Path) -> oarlock.Model:
    """The shipped sculler whose oars are states of the tree that their encoders measure, read from a file."""
    text, line = sculler().text.replace('"strapdown"', '"tree"'), "\ninput = true\n"
    assert text.count(line) == 6
    file = folder / "oars_as_states.toml"
    file.write_text(text.replace(line, "\n"), encoding="utf-8")
    return oarlock.load_model(file)


@cache
def load_exact(condition: str) -> Exact:
    """A whole recording, 40 s, by its condition: "S-NB", "B-NB", "S-B" or "B-B"."""
    return read_exact(local_folder("recordings") / f"exact_{condition}_0.npz", condition)


@cache
def load_excerpt() -> Exact:
    """The first 10 s of B-B, which ship with the tests."""
    return read_exact(EXCERPT, "B-B")


@cache
def excerpt_track(structure: str | None = None) -> oarlock.Track:
    """The excerpt, tracked by default or in another structure."""
    return oarlock.track(sculler(), load_excerpt().recording, config=oarlock.Config(structure=structure))


def read_exact(file: Path, name: str) -> Exact:
    return recordings.read_simulated(file, name, sculler())


def lossy(recording: oarlock.Recording, share: float, seed: int, whole: bool) -> oarlock.Recording:
    """A share of all rows removed at random: the same instants everywhere (`whole`), or each stream's own."""
    random = np.random.default_rng(seed)
    stays = random.random(len(recording.streams[0])) >= share
    return with_rows(recording, lambda s: stays if whole else random.random(len(s)) >= share)


def silenced(recording: oarlock.Recording, sensor: str, start_s: float, for_s: float) -> oarlock.Recording:
    """One stream holds no row for a while."""

    def rows(s: Any) -> NDArray[Any]:
        return (s.name != sensor) | (s.time_s < start_s) | (s.time_s >= start_s + for_s)

    return with_rows(recording, rows)


@dataclass(frozen=True)
class Figures:
    """Deg, mm, shares; NEES per state and NIS per reading should be near 1."""

    mean_deg: float
    worst_deg: float
    seat_mm: float
    radial_deg: float
    palmar_deg: float
    coverage: float
    hand_coverage: float
    nees: float
    whole_nees: float
    nis: float
    unit_nis: tuple[float, ...]

    def __str__(self) -> str:
        units = " ".join(f"{x:.2f}" for x in self.unit_nis)
        return (
            f"mean {self.mean_deg:.4f} worst {self.worst_deg:.4f} deg | seat {self.seat_mm:.3f} mm | "
            f"radial {self.radial_deg:.4f} palmar {self.palmar_deg:.4f} deg | in 95 % band {self.coverage:.2%} "
            f"hands {self.hand_coverage:.2%} | NEES {self.nees:.3f} (whole state {self.whole_nees:.3f}) | "
            f"NIS of all units {self.nis:.4f}, each {units}"
        )


def figures(track: oarlock.Track, exact: Exact, label: str) -> Figures:
    """Score a track by `oarlock.evaluate`, and print the figures as one row."""
    scores = oarlock.evaluate(track, exact.truth, start_s=SETTLED_S)
    sensors = {s.name: s for s in scores.sensors}
    found = Figures(
        mean_deg=scores.mean_rmse_deg(ELEVEN),
        worst_deg=scores.worst_rmse_deg(ELEVEN),
        seat_mm=1e3 * scores["seat"].rmse,
        radial_deg=scores.worst_rmse_deg(RADIAL),
        palmar_deg=scores.worst_rmse_deg(PALMAR),
        coverage=scores.mean_coverage(ELEVEN),
        hand_coverage=min(scores[name].coverage for name in HANDS),
        nees=scores.states.nees,
        whole_nees=whole_nees(track, exact),
        nis=sensors["all inertial"].nis,
        unit_nis=tuple(sensors[unit].nis for unit in UNITS),
    )
    print(f"{label:<34} {found}")
    # Evaluation counts from the track's first stamp, which may be a lost sample or two later.
    assert found.nis == pytest.approx(joint_nis(track), rel=2e-3)
    return found


def joint_nis(track: oarlock.Track) -> float:
    """NIS of all inertial readings of a sample together, per reading, once settled."""
    settled = track.time_s >= SETTLED_S
    return float(np.nansum(track.info.inertial_nis[settled]) / track.info.inertial_used[settled].sum())


def whole_nees(track: oarlock.Track, exact: Exact) -> float:
    """NEES per state of the whole state: observed joints, biases, surge and azimuth, with the full covariance."""
    beliefs = track.beliefs
    unseen = {n for n, seen in zip(track.joint_names, track.observed.all(axis=0), strict=True) if not seen}
    kept_states = [i for i, name in enumerate(beliefs.state_names) if name.partition(".")[0] not in unseen]
    nees = []
    for b in np.flatnonzero(beliefs.time_s >= SETTLED_S):
        error = (beliefs.mean[b] - true_states(exact, beliefs.state_names, beliefs.time_s[b]))[kept_states]
        covariance = beliefs.covariance[b][np.ix_(kept_states, kept_states)]
        nees.append(error @ np.linalg.solve(covariance, error) / len(error))
    return float(np.mean(nees))


def true_states(exact: Exact, names: Sequence[str], time_s: float) -> Floats:
    """The true state at a stamp of the recording."""
    truth = exact.truth
    row = int(np.argmin(np.abs(truth.time_s - time_s)))
    assert abs(truth.time_s[row] - time_s) < 1e-9
    joints = {"": truth.q, "velocity": truth.qd, "acceleration": truth.qdd}
    slow = {"surge": exact.surge_m_s2[row], "azimuth": sculler().describe().world.magnetic_azimuth_rad}
    values = []
    for name in names:
        stem, _, what = name.partition(".")
        if "_bias_" in what:
            values.append(TRUE_BIAS[exact.name])
        elif name in slow:
            values.append(slow[name])
        else:
            values.append(joints[what][row, truth.joint_names.index(stem)])
    return np.array(values)
