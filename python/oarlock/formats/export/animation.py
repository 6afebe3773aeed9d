"""Writes a track as movement of a skeleton for other software: BVH, glTF, C3D, and orientations for OpenSense."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from oarlock._core import __version__
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.formats.export.bvh import bvh_text
from oarlock.formats.export.frames import frame_places, ground_from_root
from oarlock.formats.export.gltf import glb_bytes
from oarlock.formats.export.skeleton import evenly, skeleton_of
from oarlock.formats.opensim_table import quaternion_text
from oarlock.model.rotation import continuous_quat, quat_from_matrix
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file
from oarlock.tracking.places import poses_of

if TYPE_CHECKING:
    from oarlock.tracking.track import Track

MM_PER_M = 1000.0


def write_animations(
    track: Track, place: Path, formats: Sequence[str], axes: str, names: Mapping[str, str], skip_c3d: bool
) -> tuple[list[str], tuple[str, ...]]:
    """Write animation.bvh, animation.glb, frames.c3d and orientations.sto as asked; the files' names and notes.

    `names` are plain names of the frames. glTF has Y up whatever `axes` says. With `skip_c3d` a C3D file that cannot be
    written gives a note.

    Raises:
        DataError: the track's steps are uneven, or ezc3d is not installed; only without `skip_c3d`.
    """
    assert track.model is not None
    up = np.asarray(track.model.describe().world.up)
    ground, notes = ground_from_root(up, axes == "y-up"), list[str]()
    done = []
    for kind in formats:
        if kind == "bvh":
            file = "animation.bvh"
            skeleton, left_out = skeleton_of(track, ground)
            skeleton, interpolated = evenly(skeleton)
            notes += [*left_out, *interpolated]
            write_file(place / file, bvh_text(skeleton))
        elif kind == "glb":
            file = "animation.glb"
            skeleton, left_out = skeleton_of(track, ground_from_root(up, True))
            notes += left_out
            write_file(place / file, glb_bytes(skeleton, track.model.name))
        elif kind == "c3d":
            file = "frames.c3d"
            try:
                _write_c3d(track, place / file, ground, names)
            except DataError as error:
                if not skip_c3d:
                    raise
                notes.append(str(error).replace("export: ", "frames.c3d is not written: ", 1))
                continue
        elif kind == "opensense":
            file = "orientations.sto"
            write_file(place / file, _orientations(track, ground, names))
        else:
            continue
        done.append(file)
    return done, tuple(dict.fromkeys(notes))


def _write_c3d(track: Track, file: Path, ground: Floats, names: Mapping[str, str]) -> None:
    if find_spec("ezc3d") is None:
        raise DataError("export: C3D files are written with ezc3d: pip install 'oarlock[c3d]'")
    import ezc3d

    # Readers take a point at 0, 0, 0 for one that no camera saw, and the root is always there.
    seen = frame_places(track)
    seen = Markers(seen.names[1:], seen.time_s, seen.position_m[:, 1:])
    steps = np.diff(seen.time_s)
    if steps.size and np.ptp(steps) > 0.01 * np.median(steps):
        raise DataError(
            f"export: C3D files have even steps, but those of this track vary from {steps.min():.4g} to "
            f"{steps.max():.4g} s. Track with --output-rate-hz, or leave c3d out"
        )
    position_mm = MM_PER_M * seen.position_m @ ground[:3, :3].T
    points = np.ones((4, len(seen.names), len(seen.time_s)))
    points[:3] = position_mm.transpose(2, 1, 0)
    hidden = np.isnan(points[:3]).any(axis=0)
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["LABELS"]["value"] = [names[name] for name in seen.names]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["RATE"]["value"] = [1.0 / float(np.median(steps)) if steps.size else 1.0]
    content.add_parameter("MANUFACTURER", "SOFTWARE", [f"Oarlock {__version__}"])
    content["data"]["points"] = np.where(hidden, 0.0, points)
    content["data"]["meta_points"] = {
        "residuals": np.where(hidden, -1.0, 0.0)[None],
        "camera_masks": np.zeros((7, *hidden.shape), dtype=bool),
    }
    content.write(str(file))


def _orientations(track: Track, ground: Floats, names: Mapping[str, str]) -> str:
    assert track.model is not None
    description = track.model.describe()
    carrying = {sensor.frame for sensor in description.sensors if sensor.kind in ("imu", "orientation")}
    frames = [k for k, frame in enumerate(description.frames) if frame.name in carrying]
    poses = poses_of(track)
    turns = ground[:3, :3] @ poses[:, frames, :3, :3]
    quats = [continuous_quat(quat_from_matrix(turns[:, k])) for k in range(len(frames))]
    labels = [f"{names[description.frames[k].name]}_imu" for k in frames]
    return quaternion_text(
        labels, track.time_s, np.stack(quats, axis=1) if quats else np.empty((len(track.time_s), 0, 4))
    )
