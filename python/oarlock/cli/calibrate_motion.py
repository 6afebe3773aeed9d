"""`oarlock calibrate motion | stature`: self-calibration from movement, and initial lengths from stature."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.calibrate_tree import OutFile, RecordingFolder, calibrated, saved
from oarlock.cli.options import Json, ModelName, Replace, Settings, example
from oarlock.cli.terminal import free_file, heading, number, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    group.command(
        "motion",
        epilog=example(
            "oarlock calibrate motion rec --model sculler --out cal.toml",
            "oarlock calibrate motion rec --model sculler --calibration stature.toml --until-s 60 --out cal.toml",
        ),
    )(motion)
    group.command(
        "stature", epilog=example("oarlock calibrate stature 1.84 --model sculler --out stature.toml")
    )(stature)


@verb
def motion(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    calibration: Annotated[
        Path | None,
        typer.Option(
            "--calibration", metavar="FILE", help="An earlier calibration, used as initial value and prior."
        ),
    ] = None,
    start_s: Annotated[
        float | None, typer.Option("--from-s", metavar="S", help="Start of the interval to use, s.")
    ] = None,
    end_s: Annotated[
        float | None, typer.Option("--until-s", metavar="S", help="End of the interval, s.")
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Calibrate mounts, lengths, sensor positions and encoder zeros from movement with closed loops."""
    import oarlock

    known = None if calibration is None else oarlock.load_calibration(calibration)
    search = partial(
        oarlock.calibration.calibrate_motion,
        calibration=known,
        start_s=start_s,
        end_s=end_s,
        progress=True,
    )
    calibrated(search, write_motion, recording, model, out, settings, force, json_output, shows_progress=True)


@verb
def stature(
    stature_m: Annotated[float, typer.Argument(metavar="METRES", help="Standing height without shoes, m.")],
    model: ModelName,
    out: OutFile,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Estimate a rower's segment lengths from stature, with standard deviations of 5 %."""
    import oarlock
    from oarlock.rowing import anthropometry

    free_file(out, force)
    saved(anthropometry(oarlock.load_model(model), stature_m), _write_lengths, out, json_output)
    if not json_output:
        steps(f"oarlock calibrate motion RECORDING --model {model} --calibration {out} --out cal.toml")


def _write_lengths(calibration: Calibration) -> None:
    for name, length_m in calibration.parameters.items():
        say(f"{name} = {length_m:.3f} +- {calibration.parameter_stds[name]:.3f} m", indent=2)


def write_motion(calibration: Calibration) -> None:
    """Prints which result was kept and why, and every constant with its prior."""
    noted: dict[str, Any] = dict(calibration.noted)
    start, end = noted["held_out_s"]
    heading(
        "Held-out innovations",
        f"normalised, squared, per reading, {start:.1f} to {end:.1f} s; smaller is better",
    )
    table(["calibration", ">NIS"], [(name, number(x, ".3f")) for name, x in noted["scores"].items()])
    kept = noted["kept"]
    if kept == "before":
        say("Kept: the earlier values. No candidate explained the held-out data better.", indent=2)
        return
    say(f"kept: {kept}", indent=2)
    heading("Constants", "mm and deg; explained: reduction of the prior variance by the movement")
    table(
        ["constant", ">prior", ">std", ">found", ">std", ">explained %"],
        [_row(name, found) for name, found in noted["constant"].items()],
    )
    if noted["not_told"]:
        say(f"hardly determined: {', '.join(noted['not_told'])}", style="dim", indent=2)


def _row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    scale, style = (180.0 / math.pi, ".2f") if found["unit"] == "rad" else (1e3, ".1f")
    figures = (number(scale * found[key], style) for key in ("prior", "prior_std", "found", "std"))
    return (name, *figures, number(100.0 * found["share_told"], ".0f"))
