"""Options that choose a body: whose lengths it has and which units it carries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import radians
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import assignments, names
from oarlock.cli.terminal import UsageError

if TYPE_CHECKING:
    from oarlock import Model

Stature = Annotated[
    float | None,
    typer.Option(
        "--stature-m", metavar="M", help="Standing height, m: sets the lengths of a body, e.g. 1.78."
    ),
]
Mass = Annotated[
    float | None,
    typer.Option(
        "--mass-kg", metavar="KG", help="Mass, kg, with --stature-m: sets the radii of limbs, e.g. 74."
    ),
]
Sensors = Annotated[
    str | None,
    typer.Option(
        "--sensors",
        metavar="NAMES",
        help="Inertial units that are worn, comma-separated; the body is cut to what they measure.",
    ),
]
Balls = Annotated[
    list[str] | None,
    typer.Option(
        "--ball",
        metavar="HINGE,HINGE",
        help="Make one ball of two hinges whose axes are unknown, e.g. elbow_flexion_r,elbow_pronation_r. Repeatable.",
    ),
]
Plays = Annotated[
    list[str] | None,
    typer.Option(
        "--play",
        metavar="HINGE=DEG",
        help="A hinge that also turns across its axis, and the standard deviation, e.g. knee_flexion_r=3. Repeatable.",
    ),
]

Pose = Annotated[
    str,
    typer.Option(
        "--pose",
        metavar="N|T|sitting",
        help="Still pose of the session: N (arms hanging), T (arms level) or sitting.",
    ),
]


def chosen_body(
    model: str,
    parameters: Mapping[str, float],
    stature_m: float | None = None,
    mass_kg: float | None = None,
    sensors: str | None = None,
    balls: Iterable[str] = (),
    plays: Iterable[str] = (),
) -> Model:
    """The model with these parameters, lengths of a person, units, balls in place of hinges, play."""
    from oarlock import load_model
    from oarlock.model.ball_joint import with_ball_joint
    from oarlock.model.joint_play import with_play

    body = load_model(model, parameters=parameters, stature_m=stature_m, mass_kg=mass_kg)
    body = body if sensors is None else body.with_units(names(sensors))
    for upper, lower in hinge_pairs(balls):
        body = with_ball_joint(body, upper, lower)
    std_deg = assignments(plays, "--play", "knee_flexion_r=3", "degrees")
    return with_play(body, {name: radians(deg) for name, deg in std_deg.items()}) if std_deg else body


def hinge_pairs(balls: Iterable[str] | None) -> list[tuple[str, str]]:
    """`["elbow_flexion_r,elbow_pronation_r"]` as pairs of hinges.

    Raises:
        UsageError: a text does not name two.
    """
    pairs = []
    for ball in balls or ():
        hinges = names(ball)
        if len(hinges) != 2:
            raise UsageError(f"--ball {ball}: expected two hinges, the upper one first")
        pairs.append((hinges[0], hinges[1]))
    return pairs
