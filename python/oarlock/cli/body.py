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
    typer.Option("--stature", metavar="M", help="Standing height, m: sets the lengths of a body, e.g. 1.78."),
]
Mass = Annotated[
    float | None,
    typer.Option("--mass", metavar="KG", help="Mass, kg, with --stature: sets the radii of limbs, e.g. 74."),
]
Units = Annotated[
    str | None,
    typer.Option(
        "--units",
        metavar="NAMES",
        help="Units that are worn, comma-separated; the body is cut to what they measure.",
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
    units: str | None = None,
    balls: Iterable[str] = (),
    plays: Iterable[str] = (),
) -> Model:
    """The model with these parameters, lengths of a person, units, balls in place of hinges, play."""
    from oarlock import load_model
    from oarlock.model.ball_joint import with_ball_joint
    from oarlock.model.joint_play import with_play

    body = load_model(model, parameters=parameters, stature_m=stature_m, mass_kg=mass_kg)
    body = body if units is None else body.with_units(names(units))
    for ball in balls:
        hinges = names(ball)
        if len(hinges) != 2:
            raise UsageError(f"--ball {ball}: expected two hinges, the upper one first")
        body = with_ball_joint(body, *hinges)
    std_deg = assignments(plays, "--play", "knee_flexion_r=3", "degrees")
    return with_play(body, {name: radians(deg) for name, deg in std_deg.items()}) if std_deg else body


def ball_note(ball: str) -> str:
    """What a reader of angles must know of a joint that `--ball` made."""
    from oarlock.model.ball_joint import ball_name

    upper, lower = names(ball)
    return (
        f"{ball_name(upper, lower)}: one ball in place of {upper} and {lower}, because their axes are unknown. "
        "Only the angle between the segments has a meaning. For all angles record a session (`oarlock calibrate "
        "session`, docs/calibration.md) or move the joint about both axes"
    )
