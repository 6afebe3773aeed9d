"""Simulated sculling with its truth, ways to spoil it, and the figures by which tracking it is judged."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import oarlock
from local_data import local_folder
from oarlock.tracking.track import joint_units

Floats = NDArray[np.float64]

EXCERPT = Path(__file__).parent / "data/exact_B-B_10s.npz"
UNITS = ("back", "r_upperarm", "r_forearm", "l_upperarm", "l_forearm")
ENCODERS = ("seat", "r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha")
SHOULDER = ("shoulder_abduction", "shoulder_rotation", "shoulder_flexion")
ARM = (*SHOULDER, "elbow_flexion", "elbow_rotation")
ELEVEN = ("trunk", *(f"{side}_{joint}" for side in "rl" for joint in ARM))
RADIAL = ("r_hand_abduction", "l_hand_abduction")
PALMAR = ("r_hand_flexion", "l_hand_flexion")
HANDS = RADIAL + PALMAR
SETTLED_S = 2.0
TRUE_BIAS = {"S-NB": 0.0, "B-NB": 0.0, "S-B": 0.01, "B-B": 0.01}
"""rad/s and m/s2 on every axis of every unit."""


@dataclass(frozen=True)
class Exact:
    """A simulated recording, its truth, and the boat's true acceleration (T,) m/s2, stern positive."""

    name: str
    recording: oarlock.Recording
    truth: oarlock.Track
    surge_m_s2: Floats
    positions_m: dict[str, Floats]


@cache
def sculler() -> oarlock.Model:
    return oarlock.load_model("sculler")


def oars_as_states(folder: Path) -> oarlock.Model:
    """The shipped sculler whose oars are states that their encoders measure, written as a file and read from it."""
    text, line = sculler().text, "\ninput = true\n"
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
def excerpt_track() -> oarlock.Track:
    """The excerpt, tracked by default."""
    return oarlock.track(sculler(), load_excerpt().recording)


def read_exact(file: Path, name: str) -> Exact:
    with np.load(file) as arrays:
        time_s, imu, oars = arrays["time_s"], arrays["imu"].astype(float), arrays["oar_rad"]
        encoders = np.column_stack([arrays["seat_m"], oars])
        streams: list[Any] = [
            oarlock.ImuStream(unit, time_s, gyro_rad_s=x[:, :3], accel_m_s2=x[:, 3:6], mag_ut=x[:, 6:])
            for unit, x in zip(UNITS, imu.transpose(1, 0, 2), strict=True)
        ]
        streams += [oarlock.ScalarStream(n, time_s, x) for n, x in zip(ENCODERS, encoders.T, strict=True)]
        truth = _truth(time_s, *(arrays[k] for k in ("true_q", "true_qd", "true_qdd")))
        positions = {
            k.removeprefix("true_"): arrays[k].astype(float)
            for k in arrays.files
            if k.startswith("true_") and arrays[k].ndim == 2 and arrays[k].shape[1] == 3
        }
        return Exact(name, oarlock.Recording(streams), truth, arrays["true_boat_acc_m_s2"], positions)


def _truth(time_s: Floats, q: Floats, qd: Floats, qdd: Floats) -> oarlock.Track:
    model = sculler()
    return oarlock.Track(
        model=model,
        time_s=time_s,
        joint_names=tuple(model.joint_names),
        joint_units=joint_units(model),
        q=q,
        qd=qd,
        qdd=qdd,
        **{f"{k}_std": np.full_like(q, np.nan) for k in ("q", "qd", "qdd")},
        observed=np.ones(q.shape, dtype=bool),
    )


def kept(recording: oarlock.Recording, rows_of: Callable[[Any], NDArray[Any]]) -> oarlock.Recording:
    """The recording with those rows of each stream that `rows_of(stream)` names."""
    streams: list[Any] = []
    for s in recording.streams:
        rows = rows_of(s)
        values = {name: v[rows] for name, v in s.values.items()}
        streams.append(type(s)(s.name, s.time_s[rows], **values))
    return oarlock.Recording(streams)


def lossy(recording: oarlock.Recording, share: float, seed: int, whole: bool) -> oarlock.Recording:
    """A share of all rows removed at random: the same instants everywhere (`whole`), or each stream's own."""
    random = np.random.default_rng(seed)
    stays = random.random(len(recording.streams[0])) >= share
    return kept(recording, lambda s: stays if whole else random.random(len(s)) >= share)


def silenced(recording: oarlock.Recording, sensor: str, start_s: float, for_s: float) -> oarlock.Recording:
    """One stream holds no row for a while."""

    def rows(s: Any) -> NDArray[Any]:
        return (s.name != sensor) | (s.time_s < start_s) | (s.time_s >= start_s + for_s)

    return kept(recording, rows)


def at_rate(recording: oarlock.Recording, rate_hz: float) -> oarlock.Recording:
    """The rows nearest to an even grid, with their own stamps."""

    def rows(s: Any) -> NDArray[Any]:
        grid = np.arange(s.time_s[0], s.time_s[-1], 1.0 / rate_hz)
        after = np.clip(np.searchsorted(s.time_s, grid), 1, len(s) - 1)
        nearer_before = grid - s.time_s[after - 1] <= s.time_s[after] - grid
        return np.unique(after - nearer_before)

    return kept(recording, rows)


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
