"""Options that choose a body: whose lengths it has and which units it carries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import names

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
) -> Model:
    """The model with these parameters, the lengths of a person, and these units only."""
    from oarlock import load_model

    body = load_model(model, parameters=parameters, stature_m=stature_m, mass_kg=mass_kg)
    return body if units is None else body.with_units(names(units))
