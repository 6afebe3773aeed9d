"""Positions of a rower's hips, shoulders, elbows, wrists and grips from a model's frames, for technique."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from oarlock import Model
from oarlock.model.jacobians import relative_moves
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

ARM_PARTS = ("elbow", "wrist", "hand")
PARTS = ("shoulder", *ARM_PARTS, "handle")
SIDES = ("r", "l")
NEEDED = ("seat", "r_shoulder", "l_shoulder")


@dataclass(frozen=True, eq=False)
class RowerFrames:
    """The frames of a model that are parts of a rower's body; None if the model lacks one.

    Args:
        model: with frames `seat`, `r_shoulder`, `l_shoulder`; arms and handles as in `sculler`.
    """

    model: Model

    def __post_init__(self) -> None:
        missing = [name for name in NEEDED if name not in self.model.frame_names]
        if missing:
            raise DataError(
                f"technique: the model '{self.model.name}' has no frame {', '.join(missing)}; give a rower's: sculler, "
                "sweep, ergometer, or one with their frame names"
            )

    @property
    def oars(self) -> Mapping[str, str]:
        """Joint of the horizontal oar angle by side; one oar has side ""; none on an ergometer."""
        names = {"r": "r_oar_phi", "l": "l_oar_phi", "": "oar_phi"}
        return {side: name for side, name in names.items() if name in self.model.coordinate_names}

    @property
    def handle_joints(self) -> tuple[str, ...]:
        """What moves the handles: oars, or an ergometer's chain."""
        known = ("oar_phi", "oar_alpha", "chain_yaw", "chain_pitch", "handle", "handle_yaw")
        return tuple(n for n in self.model.coordinate_names if n in known or n[2:] in known[:2])

    @property
    def trunk_joints(self) -> tuple[str, ...]:
        """What moves the shoulders against the seat."""
        return tuple(n for n in self.model.coordinate_names if n.startswith("trunk"))

    def arm_joints(self, side: str) -> tuple[str, ...]:
        """What moves elbow and wrist against the shoulder; the hand not among them."""
        stems = (f"{side}_shoulder", f"{side}_elbow")
        return tuple(n for n in self.model.coordinate_names if n.startswith(stems))

    def places(self, q: Floats, model: Model | None = None) -> dict[str, Floats]:
        """Positions (..., 3), m, aboard: in axes of `hull` if there is one, else of `root`. X left, Y up, Z sternward.

        Args:
            q: (..., n_coordinates); what was not read is NaN, and so is what depends on it.
            model: the same with other lengths; None: its own.
        """
        model = self.model if model is None else model
        names = list(model.frame_names)
        unread = _unread(q)
        poses = model.forward_kinematics(np.where(unread, 0.0, q))
        found = {name: poses[..., names.index(name), :3, 3] for name in self._frames(names)}
        if unread.any():
            self._forget(found, [model.coordinate_names[k] for k in np.flatnonzero(unread)])
        if "hull" in names:
            hull = poses[..., names.index("hull"), :, :]
            found = {name: _aboard(hull, place) for name, place in found.items()}
        return found

    def moves(self, q: Floats, grips: Collection[str] = ()) -> dict[str, Floats]:
        """Derivatives (..., 3, n_coordinates) of `places` by the coordinates: of seat, shoulders and `grips`."""
        frames, names = [*NEEDED, *grips], list(self.model.frame_names)
        read = np.where(_unread(q), 0.0, q)
        if "hull" in names:
            frames = ["hull", *frames]
            poses = self.model.forward_kinematics(read)[..., [names.index(frame) for frame in frames], :, :]
            moves = relative_moves(poses, self.model.frame_jacobian(read, frames).by_coordinate)
            frames = frames[1:]
        else:
            moves = self.model.frame_jacobian(read, frames).by_coordinate[..., :3, :]
        return {frame: moves[..., k, :, :] for k, frame in enumerate(frames)}

    def _frames(self, names: list[str]) -> list[str]:
        wanted = [f"{side}_{part}" for side in SIDES for part in PARTS]
        return [name for name in ("seat", *wanted) if name in names]

    def _forget(self, found: dict[str, Floats], unread: list[str]) -> None:
        """What was not read has no place: a handle, though the turn of an oar about itself matters to none; an arm."""
        for side in SIDES:
            own = [n for n in unread if n in self.handle_joints and n[:2] not in _other(side)]
            if own and f"{side}_handle" in found:
                found[f"{side}_handle"] = np.full_like(found[f"{side}_handle"], np.nan)
            if set(unread) & set(self.arm_joints(side)):
                own_parts = [f"{side}_{part}" for part in ARM_PARTS if f"{side}_{part}" in found]
                found.update({name: np.full_like(found[name], np.nan) for name in own_parts})


def _unread(q: Floats) -> Bools:
    return np.atleast_1d(np.isnan(q).all(axis=tuple(range(q.ndim - 1))))


def _other(side: str) -> tuple[str, ...]:
    return ("l_",) if side == "r" else ("r_",)


def _aboard(hull: Floats, place: Floats) -> Floats:
    return np.asarray(np.einsum("...ji,...j->...i", hull[..., :3, :3], place - hull[..., :3, 3]))
