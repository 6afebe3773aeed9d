"""`oarlock calibrate`: mounts, lengths, field and clocks from a recording; which unit sits where; a video's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli import calibrate_session, calibrate_text, calibrate_units, calibrate_video
from oarlock.cli.function_verbs import calibration_verb
from oarlock.cli.options import Json, ModelName, OutFile, Replace, example
from oarlock.cli.terminal import free_file, print_json, say, steps, verb

if TYPE_CHECKING:
    from oarlock import Calibration

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Calibrate mounts, lengths, biases, the magnetic field and clocks from a recording; which unit sits where.",
)
STATIC = "oarlock.calibration.static"


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    calibrate_session.add_to(group)
    calibration_verb(
        group,
        "sagittal",
        f"{STATIC}.sagittal:calibrate_sagittal",
        calibrate_text.write_sagittal,
        "oarlock calibrate sagittal rec --model lower_body --stature-m 1.78 --mass-kg 74 --out cal.toml",
        "oarlock calibrate sagittal rec --model lower_body --still-s 0 2 --out cal.toml",
        cuts=True,
    )
    calibration_verb(
        group,
        "chain",
        f"{STATIC}.hinge_chain:calibrate_hinge_chain",
        calibrate_text.write_chain,
        "oarlock calibrate chain rec --model pendulum3 --out cal.toml",
        "oarlock calibrate chain rec --model my.toml --still-s 0.5 3 --rest-q knee=0.4 --out cal.toml",
    )
    calibration_verb(
        group,
        "pose",
        f"{STATIC}.pose_mounts:calibrate_pose",
        calibrate_text.write_pose,
        "oarlock calibrate pose rec --model my.toml --out cal.toml",
    )
    calibration_verb(
        group,
        "axes",
        f"{STATIC}.hinge_axes:calibrate_hinge_axes",
        calibrate_text.write_axes,
        "oarlock calibrate axes rec --model my.toml --calibration cal.toml --out cal2.toml",
    )
    calibration_verb(
        group,
        "joints",
        f"{STATIC}.joint_centers:calibrate_joint_centers",
        calibrate_text.write_joints,
        "oarlock calibrate joints rec --model my.toml --window-s 0.3 --out cal.toml",
    )
    calibration_verb(
        group,
        "field",
        f"{STATIC}.local_field:calibrate_field",
        calibrate_text.write_field,
        "oarlock calibrate field rec --model my.toml --out cal.toml",
    )
    calibration_verb(
        group,
        "clocks",
        "oarlock.calibration.clocks.calibrate:calibrate_clocks",
        calibrate_text.write_clocks,
        "oarlock calibrate clocks rec --model sculler --out cal.toml",
        "oarlock calibrate clocks rec --model my.toml --reference encoder --out cal.toml",
    )
    calibration_verb(
        group,
        "motion",
        "oarlock.calibration.motion.calibrate:calibrate_motion",
        calibrate_text.write_motion,
        "oarlock calibrate motion rec --model sculler --out cal.toml",
        "oarlock calibrate motion rec --model sculler --calibration stature.toml --end-s 60 --out cal.toml",
    )
    group.command(
        "stature", epilog=example("oarlock calibrate stature 1.84 --model sculler --out stature.toml")
    )(stature)
    calibrate_units.add_to(group)
    calibrate_video.add_to(group)
    app.add_typer(group, name="calibrate")


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
    lengths = anthropometry(oarlock.load_model(model), stature_m)
    lengths.save(out)
    if json_output:
        print_json({"calibration": out, "parameters": lengths.parameters, "noted": lengths.noted})
        return
    say(f"Wrote {out}", style="bold")
    _write_lengths(lengths)
    steps(f"oarlock calibrate motion RECORDING --model {model} --calibration {out} --out cal.toml")


def _write_lengths(calibration: Calibration) -> None:
    for name, length_m in calibration.parameters.items():
        say(f"{name} = {length_m:.3f} +- {calibration.parameter_stds[name]:.3f} m", indent=2)
