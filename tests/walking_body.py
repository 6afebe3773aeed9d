"""A person who stands and then walks, simulated with units of any orientation, for the tests of mounts and of `run`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import Calibration, Model, Recording
from oarlock.simulation import Motion
from oarlock.storage.arrays import Floats

STILL_S, STEP_S = 3.0, 1.1
NOISE = {"gyro_rad_s": 0.01, "accel_m_s2": 0.05}
OFF_PLANE_RAD = 0.04
"""Standard deviation between people of how far hips move out of the sagittal plane."""
FIELD_UT = np.array([18.0, -44.0, 6.0])
"""In the axes of the room (X forward, Y up, Z right)."""


@dataclass(frozen=True)
class Walk:
    """A recording, its true joints, and the true mounts."""

    recording: Recording
    truth: oarlock.Track
    calibration: Calibration

    def heading_errors_rad(self, found: Calibration) -> dict[str, float]:
        """Turn about the vertical of the posture from the true to the found mount; up is Y in each link."""
        return {name: _about_up(self._off(found, name)) for name in found.mounts}

    def errors_rad(self, found: Calibration) -> dict[str, float]:
        """Angle between true and found mount of each unit."""
        return {name: float(self._off(found, name).magnitude()) for name in found.mounts}

    def _off(self, found: Calibration, name: str) -> Rotation:
        return Rotation.from_matrix(found.mounts[name][0] @ self.calibration.mounts[name][0].T)


def _about_up(turn: Rotation) -> float:
    _, y, _, w = turn.as_quat()
    return float(2.0 * np.arctan2(y, w) if w >= 0.0 else 2.0 * np.arctan2(-y, -w))


def walk(
    seed: int,
    *,
    model: Model | None = None,
    duration_s: float = 15.0,
    leaning_rad: float = 0.02,
    swing: float = 1.0,
    with_magnetometers: bool = False,
) -> Walk:
    """Stand for three seconds, then take a step every 1.1 s; the plane of each leg is its own.

    Args:
        seed: of mounts, planes and noise.
        model: the lower body, whole or with fewer units.
        duration_s: of all.
        leaning_rad: how far the pelvis tips forward and sideways and turns.
        swing: factor of the joints' movement; 0 is somebody who stands.
        with_magnetometers: whether the units read a homogeneous field, too.
    """
    model = oarlock.load_model("lower_body") if model is None else model
    random = np.random.default_rng([seed, 7])
    time_s = np.arange(0.0, duration_s, 0.02)
    names = [sensor.name for sensor in model.describe().inertial_units]
    offsets = {sensor.name: sensor.mount.offset for sensor in model.describe().inertial_units}
    turns = Rotation.random(len(names), rng=random).as_matrix()
    mounts = {name: (turn, np.asarray(offsets[name])) for name, turn in zip(names, turns, strict=True)}
    true = Calibration(mounts=mounts)
    noise = dict.fromkeys(names, NOISE)
    truth, recording = oarlock.simulate(
        model,
        Motion.from_joints(time_s, _steps(model, time_s, random, leaning_rad, swing)),
        names,
        seed=seed,
        rate_hz=100.0,
        calibration=true,
        noise=noise,
        gyro_bias_rad_s=0.01,
    )
    if with_magnetometers:
        recording = _with_field(model, recording, truth, true)
    return Walk(recording, truth, true)


def _steps(
    model: Model, time_s: Floats, random: np.random.Generator, leaning_rad: float, swing: float
) -> Mapping[str, Floats]:
    """Values of each joint: a free pelvis (K, 6), hinges (K,)."""
    begun = np.clip((time_s - STILL_S) / 1.5, 0.0, 1.0)
    strength = begun**3 * (10.0 - 15.0 * begun + 6.0 * begun**2)
    phase = 2.0 * np.pi * (time_s - STILL_S) / (2.0 * STEP_S)
    joints: dict[str, Floats] = {}
    for joint in model.describe().joints:
        side = np.pi if joint.name.endswith("_l") else 0.0
        own = phase + side
        if joint.kind == "free":
            turn = leaning_rad * np.stack([np.sin(phase), np.sin(phase + 1.0), np.sin(2.0 * phase)], axis=1)
            joints[joint.name] = np.hstack([np.zeros((len(time_s), 3)), strength[:, None] * turn])
        else:
            joints[joint.name] = swing * strength * _gait(joint.name[:-2], own, random)
    return joints


def _gait(joint: str, phase: Floats, random: np.random.Generator) -> Floats:
    """Angles of one joint in gait, rad, as in Winter's tables to some degrees."""
    return {
        "hip_flexion": 0.15 + 0.40 * np.sin(phase),
        "hip_adduction": OFF_PLANE_RAD * random.normal() * np.sin(phase + 0.5),
        "hip_rotation": OFF_PLANE_RAD * random.normal() * np.sin(phase - 0.7),
        "knee_flexion": 0.55 + 0.50 * np.sin(phase + 1.2),
        "knee_adduction": 0.0 * phase,
        "knee_rotation": 0.0 * phase,
        "ankle_dorsiflexion": 0.15 * np.sin(phase + 2.0),
        "ankle_inversion": 0.04 * np.sin(phase + 0.3),
    }[joint]


def _with_field(model: Model, recording: Recording, truth: oarlock.Track, true: Calibration) -> Recording:
    poses = model.forward_kinematics(truth.q)[..., :3, :3]
    frames = {sensor.name: sensor.frame for sensor in model.describe().inertial_units}
    streams = []
    for stream in recording:
        link = poses[:, model.frame_names.index(frames[stream.name])]
        sensor = link @ true.mounts[stream.name][0]
        streams.append(replace(stream, mag_ut=np.einsum("tji,j->ti", sensor, FIELD_UT)))
    return Recording(streams, recording.meta)
