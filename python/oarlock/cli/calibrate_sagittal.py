"""`oarlock calibrate sagittal`: mounts of any orientation from standing still and ordinary movement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.body import Mass, Sensors, Stature, chosen_body
from oarlock.cli.calibrate_tree import OutFile, RecordingFolder, Start, saved, track_next
from oarlock.cli.options import Json, ModelName, Replace, Settings, assignments, example
from oarlock.cli.terminal import free_file, number, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration

HEADINGS = {
    "movement": "its movement",
    "movement, either way": "its movement; forward or backward is not determined",
    "two hinges": "both hinges between the units",
    "north": "north of the other units",
    "nominal": "the model (not found)",
}


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "sagittal",
        short_help="Find mounts from standing still and walking, squatting or reaching.",
        epilog=example(
            "oarlock calibrate sagittal rec --model lower_body --stature-m 1.78 --mass-kg 74 --out cal.toml",
            "oarlock calibrate sagittal rec --model lower_body --still-s 0 2 --out cal.toml",
        ),
    )(sagittal)


@verb
def sagittal(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    sensors: Sensors = None,
    calibration: Start = None,
    still_s: Annotated[
        tuple[float, float] | None,
        typer.Option(
            "--still-s", metavar="START END", help="Stationary interval, s; default: the first one."
        ),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Find mounts from standing still and movement that is mostly forward and backward. They may be of any orientation.

    Stand still for two seconds in the model's rest posture (upright, arms hanging, palms inward), then walk, squat or
    reach.
    """
    import oarlock
    from oarlock.pipeline import balls_of

    free_file(out, force)
    body = chosen_body(model, assignments(settings, "--set"), stature_m, mass_kg, sensors)
    start_s, end_s = still_s or (None, None)
    known = None if calibration is None else oarlock.load_calibration(calibration)
    found = oarlock.calibration.calibrate_sagittal(
        body, oarlock.load_recording(recording), start_s=start_s, end_s=end_s, calibration=known
    )
    saved(found, write_sagittal, out, json_output)
    if not json_output:
        told = (
            ("stature-m", stature_m),
            ("mass-kg", mass_kg),
            ("sensors", sensors),
            *(("ball", ",".join(pair)) for pair in balls_of(found)),
        )
        same = "".join(f" --{name} {value}" for name, value in told if value is not None)
        steps(f"{track_next(recording, model, out)}{same}")


def write_sagittal(found: Calibration) -> None:
    """Prints one line for each unit."""
    import numpy as np

    from oarlock.pipeline import balls_of

    noted: Any = found.noted
    start_s, end_s = noted["still_s"]
    say(f"stood still from {start_s:.2f} to {end_s:.2f} s", indent=2)
    table(
        ["unit", "heading from", ">std deg", ">about one axis %"],
        [
            (
                name,
                HEADINGS[unit["heading_by"]],
                number(np.degrees(unit["heading_std_rad"]), ".0f"),
                number(100 * unit["share_about_one_axis"], ".0f"),
            )
            for name, unit in noted["sensor"].items()
        ],
    )
    for pair in noted["two_hinges"]:
        if pair["refused"]:
            say(f"axes of {' and '.join(pair['joints'])} not found: {pair['refused']}", indent=2)
    for pair in balls_of(found):
        say(f"track these as one ball joint: --ball {','.join(pair)}", indent=2)
