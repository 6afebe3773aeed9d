"""Still poses of a plan file (N, T, sitting): their postures and their steps. Used by `load_session_plan`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from oarlock.calibration.session import step_values as values
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock.storage.toml import TomlTable

STANDING = "N"
"""The rest posture of bodies: standing, arms hanging. A plan without postures has only this one."""


@dataclass(frozen=True)
class StillPose:
    """A posture that is held still.

    Args:
        name: `N`, `T`, `sitting`.
        pose: its coordinates, rad; the others are as at rest.
        movements: whether movements begin in it; otherwise they begin as their steps say.
    """

    name: str
    pose: Mapping[str, float] = field(default_factory=dict)
    movements: bool = False

    def taken_in(self, kind: str) -> bool:
        """Whether steps of this kind are in the posture."""
        return kind == "pose" or (kind == "move" and self.movements)


def still_poses(plan: TomlTable) -> dict[str, StillPose]:
    """Name -> posture of the tables [[posture]] of a plan file.

    Raises:
        DataError: a key is unknown or a value is of the wrong kind.
    """
    found = {STANDING: StillPose(STANDING)}
    for table in plan.tables("posture") if "posture" in plan.values else ():
        table.check_keys({"name", "pose", "movements"})
        name = table.string("name")
        pose = values.posture(table.values.get("pose", {}), f"{table.where()}: pose")
        found[name] = StillPose(name, pose, table.boolean("movements", False))
    return found


def chosen_pose(poses: Mapping[str, StillPose], name: str, where: str) -> StillPose:
    """The posture of this name; capitals do not matter.

    Raises:
        DataError: there is none.
    """
    for own, pose in poses.items():
        if own.casefold() == name.casefold():
            return pose
    raise DataError(
        f'{where}: has no still pose "{name}"; it has {", ".join(poses)}. {did_you_mean(name, tuple(poses))}'
    )


def belongs(poses: Sequence[str], chosen: StillPose) -> bool:
    """Whether a step with this key `poses` is done in sessions with a still pose; without the key it always is."""
    return not poses or chosen.name in poses
