"""Movements by name ("right_arm", "nod") and the sensors of a model that turn in each. Used by `assign_by_movement`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

from oarlock.recording.unit_names import place_of_name
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

_ARM, _LEG = ("upper_arm", "forearm", "hand"), ("thigh", "shank", "foot")
TRUNK = ("pelvis", "lumbar", "trunk", "thorax")
_LIMBS = {
    "arm": (_ARM, "raise the {side} arm, stiff, and lower it"),
    "elbow": (_ARM[1:], "bend the {side} elbow and straighten it"),
    "wrist": (_ARM[2:], "bend the {side} wrist"),
    "leg": (_LEG, "swing the {side} leg, knee straight, forward and back"),
    "knee": (_LEG[1:], "bend the {side} knee and straighten it"),
    "foot": (_LEG[2:], "lift the toes of the {side} foot and lower them"),
}


@dataclass(frozen=True)
class NamedMovement:
    """A movement that a person can be asked for.

    Args:
        name: as in `--order`.
        segments: those that turn in it, the proximal first.
        side: `r`, `l` or empty.
        say: what to tell the person.
    """

    name: str
    segments: tuple[str, ...]
    side: str
    say: str


def _all_movements() -> dict[str, NamedMovement]:
    sides = (("right", "r"), ("left", "l"))
    found = [
        NamedMovement(f"{word}_{limb}", segments, side, say.format(side=word))
        for limb, (segments, say) in _LIMBS.items()
        for word, side in sides
    ]
    bow = "bow from the hips with a straight back and the head in line, and come up"
    found.append(NamedMovement("bow", (*TRUNK, "head"), "", bow))
    found.append(NamedMovement("nod", ("head",), "", "nod with the head"))
    return {movement.name: movement for movement in found}


MOVEMENTS: Mapping[str, NamedMovement] = MappingProxyType(_all_movements())


def parsed_order(text: str) -> tuple[NamedMovement, ...]:
    """`"right_arm,left_arm"` as movements.

    Raises:
        DataError: a name is unknown or comes twice, or there is none.
    """
    names = [name for part in text.split(",") if (name := part.strip().lower().replace(" ", "_"))]
    if not names:
        raise DataError(f"order: names no movement. Choose among {', '.join(MOVEMENTS)}")
    for k, name in enumerate(names):
        if name not in MOVEMENTS:
            raise DataError(
                f'order: no movement is named "{name}". {did_you_mean(name, tuple(MOVEMENTS))} '
                f"Choose among {', '.join(MOVEMENTS)}"
            )
        if name in names[:k]:
            raise DataError(f'order: "{name}" comes twice; give each movement once, repeated without a rest')
    return tuple(MOVEMENTS[name] for name in names)


def turning_sensors(movement: NamedMovement, sensors: Sequence[str]) -> dict[str, float | None]:
    """Sensor -> 1 if it turns in a movement, 0 if it rests, None if it may do either."""
    found: dict[str, float | None] = {}
    for sensor in sensors:
        place = place_of_name(sensor)
        turns = place.segment in movement.segments and place.side == movement.side
        hangs = movement.name == "bow" and place.segment in (*_ARM, "shoulder")
        found[sensor] = None if hangs else float(turns)
    return found


def helpful_movements(sensors: Sequence[str], order: Sequence[NamedMovement]) -> list[str]:
    """Further movements in which some of these sensors turn."""
    given = {movement.name for movement in order}
    return [n for n, m in MOVEMENTS.items() if n not in given and any(turning_sensors(m, sensors).values())]


def in_order(model: Model, sensors: Sequence[str]) -> list[str] | None:
    """Sensors from the root outward; None if they are not on one chain."""
    described = model.describe()
    parents = {frame.name: frame.parent for frame in described.frames}
    frame_of = {sensor.name: sensor.frame for sensor in described.inertial_units}

    def way(frame: str | None) -> list[str]:
        return [] if frame is None else [*way(parents[frame]), frame]

    ways = sorted(((way(frame_of[name]), name) for name in sensors), key=lambda one: len(one[0]))
    if any(further[: len(nearer)] != nearer for (nearer, _), (further, _) in pairwise(ways)):
        return None
    return [name for _, name in ways]
