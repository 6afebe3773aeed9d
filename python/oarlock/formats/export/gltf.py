"""Writes a skeleton as glTF binary (.glb): nodes with bones as meshes, and one animation of them.

Source: Khronos Group, "glTF 2.0 Specification", 2021 (ISO/IEC 12113): sections 3.5 (nodes), 3.6 (binary data), 3.11
(animations), 4 (GLB). Metres, Y up, quaternions x, y, z, w.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oarlock._core import __version__
from oarlock.formats.export.skeleton import Skeleton
from oarlock.model.rotation import continuous_quat, quat_from_matrix
from oarlock.storage.arrays import Floats

_FLOAT, _UINT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
WIDTH_SHARE = 0.08
"""Half width of a bone against its length."""
LEAST_BONE_M = 0.005


class _Buffer:
    """Collects arrays, and their views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], kind: str, target: int | None = None) -> int:
        """Index of the accessor of these rows."""
        raw = values.tobytes()
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        self.views.append(view if target is None else {**view, "target": target})
        self.data += raw
        rows = values.reshape(len(values), -1)
        component = _FLOAT if values.dtype == np.float32 else _UINT
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": component,
                "count": len(rows),
                "type": kind,
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1


def glb_bytes(skeleton: Skeleton, name: str) -> bytes:
    """The file's contents; `name` is the scene's. The ground of `skeleton` has Y up, as glTF wants it."""
    buffer = _Buffer()
    nodes, meshes = _nodes(skeleton, buffer)
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"Oarlock {__version__}"},
        "scene": 0,
        "scenes": [{"name": name, "nodes": [0]}],
        "nodes": nodes,
        "materials": [
            {
                "name": "bone",
                "pbrMetallicRoughness": {"baseColorFactor": [0.75, 0.78, 0.82, 1.0], "metallicFactor": 0.0},
            }
        ],
        "animations": [_animation(skeleton, buffer)],
    }
    if meshes:
        content["meshes"] = meshes
    content |= {
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    return _packed(content, bytes(buffer.data))


def _packed(content: dict[str, Any], data: bytes) -> bytes:
    text = json.dumps(content, separators=(",", ":")).encode()
    chunks = b""
    for kind, chunk, filler in ((b"JSON", text, b" "), (b"BIN\0", data, b"\0")):
        filled = chunk + filler * (-len(chunk) % 4)
        chunks += struct.pack("<I", len(filled)) + kind + filled
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _nodes(skeleton: Skeleton, buffer: _Buffer) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    for k, name in enumerate(skeleton.names):
        children = skeleton.children(k)
        node: dict[str, Any] = {"name": name, "translation": skeleton.offset_m(k).tolist()}
        if children:
            node["children"] = children
        ends = [skeleton.offset_m(child) for child in children if not skeleton.slides(child)]
        bones = [end for end in (*ends, skeleton.tips_m[k]) if np.linalg.norm(end) >= LEAST_BONE_M]
        if bones:
            node["mesh"] = len(meshes)
            meshes.append(_mesh(bones, name, buffer))
        nodes.append(node)
    return nodes, meshes


def _mesh(ends_m: list[Floats], name: str, buffer: _Buffer) -> dict[str, Any]:
    corners = np.concatenate([_bone(end) for end in ends_m]).astype(np.float32)
    sides = corners.reshape(-1, 3, 3)
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    attributes = {
        "POSITION": buffer.add(corners, "VEC3", _VERTICES),
        "NORMAL": buffer.add(np.repeat(normals, 3, axis=0).astype(np.float32), "VEC3", _VERTICES),
    }
    return {"name": name, "primitives": [{"attributes": attributes, "material": 0}]}


def _bone(end_m: Floats) -> Floats:
    """Corners (24, 3) of the eight triangles of a double pyramid from the origin to `end_m`, seen counter-clockwise."""
    along = end_m / np.linalg.norm(end_m)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across *= WIDTH_SHARE * np.linalg.norm(end_m) / np.linalg.norm(across)
    ring = [across, np.cross(along, across), -across, -np.cross(along, across)]
    ring = [0.2 * end_m + corner for corner in ring]
    sides = [(ring[k], ring[(k + 1) % 4]) for k in range(4)]
    tip = [corner for a, b in sides for corner in (a, b, end_m)]
    foot = [corner for a, b in sides for corner in (b, a, np.zeros(3))]
    return np.array(tip + foot)


def _animation(skeleton: Skeleton, buffer: _Buffer) -> dict[str, Any]:
    times = buffer.add(skeleton.time_s.astype(np.float32), "SCALAR")
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []

    def add(node: int, path: str, values: Floats, kind: str) -> None:
        samplers.append(
            {"input": times, "output": buffer.add(values.astype(np.float32), kind), "interpolation": "LINEAR"}
        )
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    for k in range(len(skeleton.names)):
        position_m, rotation = skeleton.local(k)
        if skeleton.slides(k):
            add(k, "translation", position_m, "VEC3")
        if not np.allclose(rotation, np.eye(3), atol=1e-12):
            add(k, "rotation", continuous_quat(quat_from_matrix(rotation))[:, [1, 2, 3, 0]], "VEC4")
    return {"name": "track", "samplers": samplers, "channels": channels}
