"""Readers of BVH and glTF binary for tests: they share no code with the writers."""

import json
import re
import struct
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp


def bvh_positions(file: Path) -> tuple[float, dict[str, np.ndarray]]:
    """Step in s, and the position of each joint over time, (T, 3) m."""
    head, motion = file.read_text(encoding="utf-8").split("MOTION\n")
    count, step, *rows = motion.splitlines()
    values = np.array([[float(cell) for cell in row.split()] for row in rows])
    assert int(count.removeprefix("Frames: ")) == len(values)
    found: dict[str, tuple[np.ndarray, Rotation]] = {}
    stack: list[str] = []
    name, used = "", 0
    for line in head.splitlines()[1:]:
        words = line.split()
        if words[0] in ("ROOT", "JOINT", "End"):
            name = words[1] if words[0] != "End" else f"{stack[-1]}.end"
        elif words[0] == "{":
            stack.append(name)
        elif words[0] == "}":
            stack.pop()
        else:
            parent = found[stack[-2]] if len(stack) > 1 else (np.zeros(3), Rotation.identity())
            if words[0] == "OFFSET":
                place = np.array(words[1:], dtype=float) / 100.0
                found[stack[-1]] = (parent[0] + parent[1].apply(place), parent[1])
            else:
                channels = words[2:]
                block = dict(zip(channels, values[:, used : used + len(channels)].T, strict=True))
                used += len(channels)
                position = found[stack[-1]][0]
                if "Xposition" in block:
                    local = np.stack([block[f"{axis}position"] for axis in "XYZ"], axis=1) / 100.0
                    position = parent[0] + parent[1].apply(local)
                order = "".join(c[0] for c in channels if c.endswith("rotation"))
                angles = np.stack([block[f"{axis}rotation"] for axis in order], axis=1)
                found[stack[-1]] = (position, parent[1] * Rotation.from_euler(order, angles, degrees=True))
    assert used == values.shape[1]
    step_s = float(step.removeprefix("Frame Time: "))
    return step_s, {n: np.broadcast_to(p, (len(values), 3)) for n, (p, _) in found.items()}


def glb_positions(file: Path, time_s: np.ndarray) -> dict[str, np.ndarray]:
    """Position of each node at these times, (T, 3) m."""
    raw = file.read_bytes()
    magic, version, length = struct.unpack("<4sII", raw[:12])
    assert (magic, version, length) == (b"glTF", 2, len(raw))
    size = struct.unpack("<I", raw[12:16])[0]
    content, data = json.loads(raw[20 : 20 + size]), raw[28 + size :]

    def rows(k: int) -> np.ndarray:
        accessor = content["accessors"][k]
        view = content["bufferViews"][accessor["bufferView"]]
        width = int(re.sub(r"\D", "", accessor["type"]) or 1)
        flat = np.frombuffer(data, np.float32, accessor["count"] * width, view["byteOffset"])
        return flat.reshape(-1, width).astype(float)

    moved: dict[tuple[int, str], np.ndarray] = {}
    animation = content["animations"][0]
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        at_s, values = rows(sampler["input"])[:, 0], rows(sampler["output"])
        target = channel["target"]
        if target["path"] == "rotation":
            moved[target["node"], "rotation"] = Slerp(at_s, Rotation.from_quat(values))(
                np.clip(time_s, at_s[0], at_s[-1])
            )
        else:
            moved[target["node"], "translation"] = np.stack(
                [np.interp(time_s, at_s, v) for v in values.T], axis=1
            )
    found: dict[str, np.ndarray] = {}

    def visit(k: int, place: np.ndarray, turn: Rotation) -> None:
        node = content["nodes"][k]
        here = place + turn.apply(moved.get((k, "translation"), np.array(node["translation"])))
        found[node["name"]] = here
        for child in node.get("children", ()):
            visit(child, here, turn * moved.get((k, "rotation"), Rotation.identity()))

    visit(
        content["scenes"][0]["nodes"][0],
        np.zeros((len(time_s), 3)),
        Rotation.from_quat(np.tile([0, 0, 0, 1], (len(time_s), 1))),
    )
    return found
