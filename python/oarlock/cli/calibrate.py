"""`oarlock calibrate`: finds mounts and lengths from a recording. Contains the verb `chain` and its tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli import (
    calibrate_clocks,
    calibrate_motion,
    calibrate_sagittal,
    calibrate_session,
    calibrate_tree,
    calibrate_units,
    calibrate_video,
)
from oarlock.cli.calibrate_tree import OutFile, RecordingFolder, Still, saved
from oarlock.cli.options import Json, ModelName, Replace, Settings, assignments, example, names
from oarlock.cli.terminal import free_file, heading, number, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Calibrate mounts, lengths, biases, the magnetic field and clocks from a recording; which unit sits where.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    calibrate_session.add_to(group)
    calibrate_sagittal.add_to(group)
    calibrate_tree.add_to(group)
    calibrate_clocks.add_to(group)
    calibrate_motion.add_to(group)
    calibrate_units.add_to(group)
    calibrate_video.add_to(group)
    app.add_typer(group, name="calibrate")


@group.command(
    "chain",
    epilog=example(
        "oarlock calibrate chain rec --model pendulum3 --out cal.toml",
        "oarlock calibrate chain rec --model my.toml --still-s 0.5 3 --rest knee=0.4 --out cal.toml",
    ),
)
@verb
def chain(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    sensors: Annotated[
        str | None,
        typer.Option(
            "--sensors", metavar="NAMES", help="Sensors of the chain, comma-separated; default: all recorded."
        ),
    ] = None,
    still_s: Still = None,
    swing_s: Annotated[
        tuple[float, float] | None,
        typer.Option("--swing-s", metavar="START END", help="Swing interval, s; default: all other times."),
    ] = None,
    rest: Annotated[
        list[str] | None,
        typer.Option(
            "--rest",
            metavar="JOINT=VALUE",
            help="Posture in the stationary interval, rad; default 0. Repeatable.",
        ),
    ] = None,
    first_turn_positive: Annotated[
        bool,
        typer.Option(
            "--first-turn-positive/--first-turn-negative",
            help="Sign of the first clear rotation of the first hinge.",
        ),
    ] = True,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Calibrate sensor mounts on a chain of hinges from a stationary interval and a swing."""
    import oarlock

    body = oarlock.load_model(model, parameters=assignments(settings, "--set"))
    free_file(out, force)
    calibration = oarlock.calibration.calibrate_hinge_chain(
        body,
        oarlock.load_recording(recording),
        sensors=None if sensors is None else names(sensors),
        still_s=still_s,
        swing_s=swing_s,
        rest_q=assignments(rest, "--rest"),
        first_turn_positive=first_turn_positive,
    )
    saved(calibration, write_chain, out, json_output)
    if json_output:
        return
    only = f" --streams {','.join(calibration.mounts)}" if calibration.noted["left_out"] else ""
    steps(f"oarlock track {recording} --model {model} --calibration {out}{only} --out {recording}-track")


def write_chain(calibration: Calibration) -> None:
    """Prints the uncertainty of each mount, the lengths, and what keeps the model's nominal value."""
    noted: dict[str, Any] = dict(calibration.noted)
    start, end = noted["still_s"]
    heading("Mounts", f"stationary from {start:.2f} to {end:.2f} s")
    table(
        [
            "sensor",
            "hinge",
            ">from/to deg",
            ">std about hinge, up, third deg",
            ">gravity-axis deg",
            ">off axis %",
        ],
        [
            (
                name,
                found["joint"],
                _degrees(found["swing_range_rad"], "+.0f"),
                _degrees([found[f"std_about_{turn}_rad"] for turn in ("hinge", "up", "third")], ".1f"),
                _degrees([found["disagreement_rad"]], "+.1f"),
                number(100.0 * found["off_axis_share"], ".2f"),
            )
            for name, found in noted["sensor"].items()
        ],
    )
    heading("Sensor positions", "in axes of the link's frame; magnetometer in sensor axes")
    table(
        ["sensor", ">offset mm", ">accel residual m/s2", ">magnetometer offset uT", ">field residual uT"],
        [
            (
                name,
                ", ".join(f"{1e3 * x:.0f}" for x in calibration.mounts[name][1]),
                number(found.get("residual_m_s2"), ".2f"),
                _offset(found),
                _residuals(found),
            )
            for name, found in noted["sensor"].items()
        ],
    )
    for parameter, value in calibration.parameters.items():
        say(f"{parameter} = {value:.3f} m", indent=2)
    for title, lines in (
        ("kept at the model's nominal value", noted["kept_nominal"]),
        ("not used", noted["left_out"]),
    ):
        if lines:
            say(f"{title}: {'; '.join(lines)}", style="dim", indent=2)


def _degrees(angles_rad: list[float], style: str) -> str:
    return ", ".join(format(math.degrees(angle), style) for angle in angles_rad)


def _offset(found: dict[str, Any]) -> str:
    if "mag_offset_ut" not in found:
        return ""
    text = ", ".join(f"{x:.1f}" for x in found["mag_offset_ut"])
    return text if found["mag_offset_used"] else f"({text}) not used"


def _residuals(found: dict[str, Any]) -> str:
    if "mag_offset_ut" not in found:
        return ""
    return f"{found['mag_residual_without_ut']:.1f} without, {found['mag_residual_ut']:.1f} with"
