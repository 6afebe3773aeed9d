"""`oarlock calibrate`: from a recording to how the sensors sit."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli import calibrate_clocks, calibrate_motion, calibrate_session, calibrate_tree
from oarlock.cli.options import Json, ModelName, Settings, assignments, example, names
from oarlock.cli.terminal import free_file, heading, number, print_json, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Find how the sensors of one wearing sit, where joints lie, the magnetic field, and clocks that are off.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    calibrate_session.add_to(group)
    calibrate_tree.add_to(group)
    calibrate_clocks.add_to(group)
    calibrate_motion.add_to(group)
    app.add_typer(group, name="calibrate")


@group.command(
    "chain",
    epilog=example(
        "oarlock calibrate chain rec --model pendulum3 --out cal.toml",
        "oarlock calibrate chain rec --model my.toml --still 0.5 3 --rest knee=0.4 --out cal.toml",
    ),
)
@verb
def chain(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="A recording folder.")],
    model: ModelName,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Calibration file to write.")],
    settings: Settings = None,
    sensors: Annotated[
        str | None,
        typer.Option(
            "--sensors", metavar="NAMES", help="The chain's sensors, with commas; else all recorded."
        ),
    ] = None,
    still: Annotated[
        tuple[float, float] | None,
        typer.Option("--still", metavar="START END", help="The still stretch, s; else the longest one."),
    ] = None,
    swing: Annotated[
        tuple[float, float] | None,
        typer.Option("--swing", metavar="START END", help="The swing, s; else all but the still stretch."),
    ] = None,
    rest: Annotated[
        list[str] | None,
        typer.Option(
            "--rest", metavar="JOINT=VALUE", help="Posture of the still stretch, rad; else 0. Repeatable."
        ),
    ] = None,
    first_turn_positive: Annotated[
        bool,
        typer.Option(
            "--first-turn-positive/--first-turn-negative", help="Sense of the first hinge's first clear turn."
        ),
    ] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
    json_output: Json = False,
) -> None:
    """Find the mounts of sensors on a chain of hinges, from a still stretch and a swing."""
    import oarlock

    body = oarlock.load_model(model, parameters=assignments(settings, "--set"))
    free_file(out, force)
    calibration = oarlock.calibrate_hinge_chain(
        body,
        oarlock.load_recording(recording),
        sensors=None if sensors is None else names(sensors),
        still_s=still,
        swing_s=swing,
        rest_q=assignments(rest, "--rest"),
        first_turn_positive=first_turn_positive,
    )
    calibration.save(out)
    if json_output:
        print_json({"calibration": out, "parameters": calibration.parameters, "noted": calibration.noted})
        return
    say(f"Wrote {out}", style="bold")
    write_chain(calibration)
    only = f" --only {','.join(calibration.mounts)}" if calibration.noted["left_out"] else ""
    steps(f"oarlock track {recording} --model {model} --calibration {out}{only} --out {recording}-track")


def write_chain(calibration: Calibration) -> None:
    """Prints how well each mount was found, the lengths, and what stays as the model has it."""
    noted: dict[str, Any] = dict(calibration.noted)
    start, end = noted["still_s"]
    heading("Mounts", f"still from {start:.2f} to {end:.2f} s")
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
    heading("Where they sit", "in axes of the link's frame; magnetometer in the sensor's own")
    table(
        ["sensor", ">offset mm", ">left of accel m/s2", ">magnetometer offset uT", ">left of the field uT"],
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
        ("kept as the model has it", noted["kept_nominal"]),
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
