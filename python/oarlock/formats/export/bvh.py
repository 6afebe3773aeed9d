"""Writes a skeleton as BVH (Biovision hierarchy), which Blender, MotionBuilder and others open.

Source: M. Meredith, S. Maddock, "Motion capture file formats explained", University of Sheffield 2001, section 3. The
channels of a node are its position and its rotations Z, X, Y about its own moved axes. With all rotations 0 the body is
in its neutral pose.
"""

from __future__ import annotations

import numpy as np

from oarlock.formats.export.skeleton import Skeleton
from oarlock.model.angle_sequence import angles_from_quat
from oarlock.model.rotation import quat_from_matrix
from oarlock.storage.arrays import Floats

CM_PER_M = 100.0
_SEQUENCE = "ZXY"
_ROTATIONS = " ".join(f"{axis}rotation" for axis in _SEQUENCE)
_POSITIONS = "Xposition Yposition Zposition"


def bvh_text(skeleton: Skeleton) -> str:
    """The file's text: lengths in cm, angles in deg. The steps of `skeleton` are even."""
    lines = ["HIERARCHY", *_node(skeleton, 0, 0)]
    step_s = float(np.median(np.diff(skeleton.time_s))) if len(skeleton.time_s) > 1 else 0.01
    lines += ["MOTION", f"Frames: {len(skeleton.time_s)}", f"Frame Time: {step_s:.9g}"]
    rows = np.concatenate([_channels(skeleton, node) for node in _depth_first(skeleton, 0)], axis=1)
    lines += [" ".join(f"{value:.6f}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def _node(skeleton: Skeleton, node: int, depth: int) -> list[str]:
    tab = "\t" * depth
    kind = "JOINT" if depth else "ROOT"
    slides = skeleton.slides(node)
    channels = f"CHANNELS 6 {_POSITIONS} {_ROTATIONS}" if slides else f"CHANNELS 3 {_ROTATIONS}"
    lines = [f"{tab}{kind} {skeleton.names[node]}", f"{tab}{{"]
    lines += [f"{tab}\tOFFSET {_vector(skeleton.offset_m(node))}", f"{tab}\t{channels}"]
    children = skeleton.children(node)
    for child in children:
        lines += _node(skeleton, child, depth + 1)
    if not children:
        tip = _vector(skeleton.tips_m[node])
        lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {tip}", f"{tab}\t}}"]
    return [*lines, f"{tab}}}"]


def _depth_first(skeleton: Skeleton, node: int) -> list[int]:
    return [node, *(k for child in skeleton.children(node) for k in _depth_first(skeleton, child))]


def _channels(skeleton: Skeleton, node: int) -> Floats:
    position_m, rotation = skeleton.local(node)
    angles_deg = np.degrees(angles_from_quat(quat_from_matrix(rotation), _SEQUENCE))
    return np.hstack([CM_PER_M * position_m, angles_deg]) if skeleton.slides(node) else angles_deg


def _vector(values_m: Floats) -> str:
    return " ".join(f"{CM_PER_M * value + 0.0:.6f}" for value in values_m)
