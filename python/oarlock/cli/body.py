"""Options that choose a body: whose lengths it has and which units it carries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians
from typing import TYPE_CHECKING

from oarlock.cli.terminal import UsageError
from oarlock.cli.verbs import ModelName, assignments, names

if TYPE_CHECKING:
    from oarlock import Model


@dataclass(frozen=True)
class Body:
    """A model, the options that chose it, to be typed again with the next verb, its name or file, and parameters."""

    model: Model
    words: str
    name: str
    parameters: Mapping[str, float]


def body_of(
    *,
    model: ModelName,
    set_: dict[str, float] | None = None,
    stature_m: float | None = None,
    mass_kg: float | None = None,
    sensors: tuple[str, ...] | None = None,
) -> Body:
    """The model with these parameters, lengths of a person and units.

    Args:
        model: name of a shipped model, or a model file.
        set_: a model parameter, e.g. l_ua_r=0.31 (SI). Repeatable.
        stature_m: standing height, m: sets the lengths of a body, e.g. 1.78.
        mass_kg: mass, kg, with --stature-m: sets the radii of limbs, e.g. 74.
        sensors: inertial units that are worn, comma-separated; the body is cut to what they measure.
    """
    from oarlock import load_model

    body = load_model(model, parameters=set_ or {}, stature_m=stature_m, mass_kg=mass_kg)
    words = [f"--model {model}", *(f"--set {name}={value:g}" for name, value in (set_ or {}).items())]
    words += [] if stature_m is None else [f"--stature-m {stature_m:g}"]
    words += [] if mass_kg is None else [f"--mass-kg {mass_kg:g}"]
    if sensors is not None:
        body, words = body.with_units(sensors), [*words, f"--sensors {','.join(sensors)}"]
    return Body(body, " ".join(words), model, set_ or {})


def with_loose_joints(body: Model, balls: Sequence[str], plays: Sequence[str]) -> Model:
    """The model with balls in place of pairs of hinges, and with play of hinges, `knee_flexion_r=3` (deg)."""
    from oarlock.model.ball_joint import with_ball_joint
    from oarlock.model.joint_play import with_play

    for upper, lower in hinge_pairs(balls):
        body = with_ball_joint(body, upper, lower)
    std_deg = assignments(plays, "--play", "knee_flexion_r=3", "degrees")
    return with_play(body, {name: radians(deg) for name, deg in std_deg.items()}) if std_deg else body


def hinge_pairs(balls: Sequence[str]) -> list[tuple[str, str]]:
    """`["elbow_flexion_r,elbow_pronation_r"]` as pairs of hinges.

    Raises:
        UsageError: a text does not name two.
    """
    pairs = []
    for ball in balls:
        hinges = names(ball)
        if len(hinges) != 2:
            raise UsageError(f"--ball {ball}: expected two hinges, the upper one first")
        pairs.append((hinges[0], hinges[1]))
    return pairs
