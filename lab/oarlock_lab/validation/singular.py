"""A simulated arm whose shoulder passes again and again through the pose in which a three-hinge shoulder is
singular.

Every chain of three hinges has such poses: two of its axes coincide, and no rate of the hinges follows a turn
about the third direction. The truth is simulated with hinges that are counted from that pose and far from a pole
of their own (models/arm_truth.toml), so that the units feel a smooth motion, and nothing in the data knows of the
other chain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import Recording, Track
from oarlock.evaluation.reference import Reference
from oarlock.recording import ImuStream
from oarlock.simulation import Motion
from oarlock.storage.arrays import Floats

from . import chains, others, ours
from .chains import Link
from .estimate import OrientationEstimate, Outcome, attempt
from .results import Collected, Plot, SetResult
from .rotations import rotation
from .scores import HEADED, heading_zeroed, hinge_error_rad, rmse_deg, world_error
from .worst_window import Errors, window_plot, worst_of, worst_window

MODELS = Path(__file__).parent / "models"
SEEDS = (1, 2, 3)
LASTS_S = 40.0
RATE_HZ = 100.0
KNOT_S = 0.05

# The arm swings through the raised pose, each time in another direction, and misses the pole by a degree or two.
SWING_HZ = 0.25
SWING_RAD = np.radians(50.0)
MISS_RAD = np.radians(2.0)
SPIN_RAD = np.radians(35.0)
ELBOW_RAD = np.radians((-100.0, -20.0))

# Of small units on the market after their own calibration.
GYRO_BIAS_RAD_S = 0.005
ACCEL_BIAS_M_S2 = 0.05

SCORED_AFTER_S = 2.0
HEADING_AT_S = 1.0
NEAR_POLE_RAD = np.radians(15.0)
LOST_RAD = np.radians(20.0)
JUMP_RAD = np.radians(90.0)
WINDOW_S = 6.0

BODIES = ("upper_arm", "forearm")
CHAIN = (Link("upper_arm", "yxz"), Link("forearm", "y"))
SHOULDER = slice(0, 3)
HINGES = ("shoulder_flexion", "shoulder_abduction", "shoulder_rotation")
VQF_MODES = ("VQF 6D", "VQF 9D")

NAME = "singular"
TITLE = "A shoulder that passes its gimbal pose (simulated)"
TEXT = (
    "Upper arm and forearm on a fixed shoulder, a 9-axis unit on each, 100 Hz, 40 s, three seeds. Flexion, abduction "
    "and rotation of the shoulder have a pole where the arm is raised sideways; the arm swings through that pose twice "
    "in four seconds, each time in another direction. Scored after 2 s is the orientation of the upper arm in the "
    "world. Estimates without magnetometer get their heading at 1 s. Lost: how often the error rises above 20 deg. "
    "Flips: shoulder angles that change by more than 90 deg from one sample to the next; an orientation has none."
)


@dataclass(frozen=True, eq=False)
class HingeTrial:
    """One simulated recording with its truth."""

    recording: Recording
    reference: Reference

    @property
    def pole_distance_rad(self) -> Floats:
        """(T,) how far the upper arm is from the pole of flexion, abduction and rotation."""
        matrices = rotation(self.reference.quat_wxyz["upper_arm"]).as_matrix()
        return np.asarray(np.pi / 2 - np.abs(np.arcsin(np.clip(-matrices[:, 1, 2], -1.0, 1.0))))


@dataclass(frozen=True, eq=False)
class ReportedLink:
    """An estimate, and the shoulder's angles (T, 3) that its software reports, rad; None if it reports none."""

    outcome: Outcome
    angles_rad: Floats | None = None


def run(_data_folder: Path) -> SetResult:
    """Simulate and score all seeds; needs no data."""
    each = Collected()
    more: dict[str, tuple[bool, list[dict[str, float | None]]]] = {}
    plots: list[tuple[float, Plot | None]] = []
    for seed in SEEDS:
        trial = simulated(seed)
        errors: dict[str, tuple[OrientationEstimate, Floats]] = {}
        for reported in _reported(trial):
            outcome = reported.outcome
            if not isinstance(outcome, OrientationEstimate):
                each.add(outcome, {})
                continue
            outcome = _headed(outcome, trial.reference)
            error = _upper_arm_error_rad(outcome, trial.reference)
            scored_rows = trial.reference.time_s > SCORED_AFTER_S
            each.add(outcome, {f"seed {seed}": rmse_deg(error, scored_rows)})
            figures = _figures(outcome, reported.angles_rad, error, trial)
            more.setdefault(outcome.name, (outcome.ours, []))[1].append(figures)
            errors[outcome.name] = outcome, np.degrees(error)
        plots.append(_plot(seed, trial, errors))
    details = Collected()
    for name, (is_ours, rows) in more.items():
        figures = {key: _over_seeds(key, [row[key] for row in rows]) for key in rows[0]}
        note = "" if len(rows) == len(SEEDS) else f"{len(rows)} of {len(SEEDS)} seeds ran"
        details.put(name, figures, note, is_ours)
    tables = (
        each.table("Upper arm in the world, RMSE after 2 s", mean=True),
        details.table("The same, over all seeds", unit="", text=DETAILS_TEXT),
    )
    return SetResult(NAME, TITLE, TEXT, tables, worst_of(plots))


DETAILS_TEXT = (
    "RMSE and means over the seeds; the largest error of any seed; lost and flips in all seeds together."
)


def simulated(seed: int) -> HingeTrial:
    """Recording and truth of one seed."""
    model = oarlock.load_model(str(MODELS / "arm_truth.toml"))
    random = np.random.default_rng(seed)
    biases = {
        name: {
            "gyro": random.normal(0.0, GYRO_BIAS_RAD_S, 3),
            "accel": random.normal(0.0, ACCEL_BIAS_M_S2, 3),
        }
        for name in model.sensor_names
    }
    truth, recording = oarlock.simulate(
        model,
        motion(seed),
        seed=seed,
        rate_hz=RATE_HZ,
        gyro_bias_rad_s={n: b["gyro"] for n, b in biases.items()},
        accel_bias_m_s2={n: b["accel"] for n, b in biases.items()},
    )
    joints = ("tilt_x", "tilt_y", "spin_z", "elbow")
    angles = truth.q[:, [truth.coordinate_names.index(joint) for joint in joints]]
    raised = Rotation.from_euler("x", np.pi / 2)
    quats = chains.world_from_links((Link("upper_arm", "xyz"), Link("forearm", "y")), angles, raised)
    return HingeTrial(recording, Reference("simulated", truth.time_s, quats))


def motion(seed: int) -> Motion:
    """Smooth joint angles of the simulated arm."""
    random = np.random.default_rng([seed, 7])
    time_s = np.arange(-1.0, LASTS_S + 1.0, KNOT_S)
    swing = SWING_RAD * np.sin(2 * np.pi * SWING_HZ * time_s + random.uniform(0, 2 * np.pi))
    direction = 2 * np.pi * _wander(random, time_s)
    miss = MISS_RAD * np.column_stack([_wander(random, time_s) for _ in range(2)])
    spin = SPIN_RAD * _wander(random, time_s)
    bent = 0.5 * (1.0 + _wander(random, time_s))
    elbow = ELBOW_RAD[0] + (ELBOW_RAD[1] - ELBOW_RAD[0]) * bent
    q = np.column_stack(
        [swing * np.cos(direction) + miss[:, 0], swing * np.sin(direction) + miss[:, 1], spin, elbow]
    )
    return Motion(("tilt_x", "tilt_y", "spin_z", "elbow"), time_s, q)


def _wander(random: np.random.Generator, time_s: Floats) -> Floats:
    """A smooth course between -1 and 1: three slow sines."""
    frequencies_hz, phases = random.uniform(0.03, 0.3, 3), random.uniform(0, 2 * np.pi, 3)
    return np.asarray(np.mean(np.sin(2 * np.pi * np.outer(time_s, frequencies_hz) + phases), axis=1))


def _reported(trial: HingeTrial) -> Iterator[ReportedLink]:
    yield from _ours(trial)
    for source in attempt(VQF_MODES, lambda: others.vqf(trial.recording, VQF_MODES)):
        yield ReportedLink(source)
        if isinstance(source, OrientationEstimate):
            # Without a common heading no chain fits: the same help as for the score.
            yield from _chained(_headed(source, trial.reference))


def _ours(trial: HingeTrial) -> Iterator[ReportedLink]:
    plain = Recording([_without_mag(stream) for stream in trial.recording if isinstance(stream, ImuStream)])
    for label in ("ball", "hinges"):
        for recording, mode in ((plain, f"{label} 6D"), (trial.recording, f"{label} 9D")):
            yield from _tracked(str(MODELS / f"arm_{label}.toml"), mode, recording)


def _tracked(model_file: str, mode: str, recording: Recording) -> Iterator[ReportedLink]:
    tracks: list[Track] = []

    def estimates() -> Iterator[OrientationEstimate]:
        for estimate, track in ours.track_arm(model_file, mode, recording):
            tracks.append(track)
            yield estimate

    outcomes = attempt([name.replace("Oarlock", f"Oarlock {mode}") for name in ours.NAMES], estimates)
    for i, outcome in enumerate(outcomes):
        has_angles = isinstance(outcome, OrientationEstimate) and set(HINGES) <= set(tracks[i].joint_names)
        columns = [tracks[i].coordinate_names.index(joint) for joint in HINGES] if has_angles else []
        angles = tracks[i].q[:, columns] if has_angles else None
        yield ReportedLink(outcome, angles)


def _without_mag(stream: ImuStream) -> ImuStream:
    return ImuStream(stream.name, stream.time_s, gyro_rad_s=stream.gyro_rad_s, accel_m_s2=stream.accel_m_s2)


def _chained(source: OrientationEstimate) -> Iterator[ReportedLink]:
    for outcome, posture in chains.on_chain(source, CHAIN):
        yield ReportedLink(outcome, posture.angles_rad[:, SHOULDER] if posture is not None else None)


def _headed(estimate: OrientationEstimate, reference: Reference) -> OrientationEstimate:
    """Software that knows the chain gets one heading, software that does not one for each unit; 9D needs none."""
    if "6D" not in estimate.name or HEADED in estimate.note:
        return estimate
    knows_chain = estimate.ours or " + " in estimate.name
    return heading_zeroed(estimate, reference, HEADING_AT_S, "upper_arm" if knows_chain else None)


def _upper_arm_error_rad(estimate: OrientationEstimate, reference: Reference) -> Floats:
    difference, good = world_error(estimate, reference, "upper_arm")
    return np.where(good, difference.magnitude(), np.nan)


def _figures(
    estimate: OrientationEstimate, angles_rad: Floats | None, error_rad: Floats, trial: HingeTrial
) -> dict[str, float | None]:
    rows = trial.reference.time_s > SCORED_AFTER_S
    near = trial.pole_distance_rad < NEAR_POLE_RAD
    elbow = hinge_error_rad(estimate, trial.reference, BODIES, "y")
    lost = np.nan_to_num(error_rad[rows]) > LOST_RAD
    flips = None
    if angles_rad is not None:
        steps = np.abs(np.diff(angles_rad[estimate.time_s > SCORED_AFTER_S], axis=0)).max(axis=1)
        flips = float(np.count_nonzero(steps > JUMP_RAD))
    return {
        "near the pole, deg": rmse_deg(error_rad, rows & near),
        "far from it, deg": rmse_deg(error_rad, rows & ~near),
        "largest, deg": float(np.degrees(np.nanmax(error_rad[rows]))),
        "elbow, deg": rmse_deg(elbow, rows),
        "lost": float(np.count_nonzero(lost[1:] & ~lost[:-1]) + lost[0]),
        "flips": flips,
    }


def _over_seeds(key: str, values: list[float | None]) -> float | int | None:
    numbers = [v for v in values if v is not None]
    if not numbers:
        return None
    if key in ("lost", "flips"):
        return int(sum(numbers))
    return float(max(numbers) if key.startswith("largest") else np.mean(numbers))


def _plot(seed: int, trial: HingeTrial, errors: Errors) -> tuple[float, Plot | None]:
    """The stretch that is worst for inverse kinematics on three hinges, or for the leading estimate without any.

    Only what has magnetometers and no look ahead is drawn: the others drift in heading, which is no matter of hinges.
    """
    errors = {n: e for n, e in errors.items() if "9D" in n and "smoothed" not in n}
    time_s = trial.reference.time_s
    if not errors:
        return 0.0, None
    chained: Errors = {name: e for name, e in errors.items() if " + " in name} or errors
    window = worst_window(chained, time_s, time_s > SCORED_AFTER_S, WINDOW_S)
    title = f"Seed {seed}, the worst {WINDOW_S:.0f} s of inverse kinematics: {window.text}"
    truth = [("distance from the pole, deg", np.degrees(trial.pole_distance_rad))]
    return window.rms_deg, window_plot(f"singular-{seed}", title, errors, time_s, window, truth)
