"""Bodies that move as told, with markers on them; places of points by the model's forward kinematics alone."""

import numpy as np

import oarlock
from oarlock.markers import Attachment, Markers
from oarlock.simulation import Motion

ARM_LIMIT_SHARE = 0.2


def arm_motion(model: oarlock.Model, duration_s: float, seed: int, share: float = ARM_LIMIT_SHARE) -> Motion:
    """Every joint swings about the middle of its limits by a share of their range, less than once a second."""
    random = np.random.default_rng(seed)
    time_s = np.arange(-0.1, duration_s + 0.1, 0.01)
    columns = []
    for joint in model.describe().joints:
        low, high = joint.limits
        rate, phase = random.uniform(0.2, 0.9), random.uniform(0, 2 * np.pi)
        columns.append(0.5 * (low + high) + share * (high - low) * np.sin(2 * np.pi * rate * time_s + phase))
    return Motion(tuple(model.joint_names), time_s, np.stack(columns, axis=1))


def clusters(frames: list[str], each: int, radius_m: float, seed: int) -> tuple[Attachment, ...]:
    """Markers of which every frame has some, on a sphere around its origin."""
    random = np.random.default_rng(seed)
    found = []
    for frame in frames:
        for k in range(each):
            way = random.standard_normal(3)
            found.append(Attachment(f"{frame}_{k}", frame, radius_m * way / np.linalg.norm(way)))
    return tuple(found)


def postures(model: oarlock.Model, motion: Motion, time_s: np.ndarray) -> np.ndarray:
    order = [motion.coordinate_names.index(name) for name in model.coordinate_names]
    return motion.at(time_s)[:, order]


def markers_on(
    model: oarlock.Model,
    q: np.ndarray,
    time_s: np.ndarray,
    attachments: tuple[Attachment, ...],
    noise_m: float = 0.0,
    seed: int = 0,
) -> Markers:
    poses = model.forward_kinematics(q)
    places = []
    for a in attachments:
        pose = poses[:, model.frame_names.index(a.frame)]
        places.append(np.einsum("tij,j->ti", pose[:, :3, :3], a.point_m) + pose[:, :3, 3])
    position = np.stack(places, axis=1)
    noise = noise_m * np.random.default_rng(seed).standard_normal(position.shape)
    return Markers(tuple(a.marker for a in attachments), time_s, position + noise)


def with_gaps(markers: Markers, length_s: float, seed: int, spacing_s: float = 0.35) -> tuple[Markers, dict]:
    """Each marker loses one stretch, at another time; also which, as {marker: (first missing stamp, frames)}."""
    random = np.random.default_rng(seed)
    position, told = np.array(markers.position_m), {}
    frames = round(length_s * markers.rate_hz)
    for k, name in enumerate(markers.names):
        first = random.integers(
            round(spacing_s * markers.rate_hz), len(markers) - frames - round(spacing_s * markers.rate_hz)
        )
        position[first : first + frames, k] = np.nan
        told[name] = (float(markers.time_s[first]), frames)
    return Markers(markers.names, markers.time_s, position), told
