"""`oarlock calibrate`: mounts, lengths, field and clocks from a recording; which unit sits where; a video's clock."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli import calibrate_session, calibrate_text, calibrate_units, calibrate_video
from oarlock.cli.terminal import progress, say, steps
from oarlock.cli.verbs import REQUIRED, FunctionText, ModelName, NewFile, Option, add_verb, command

if TYPE_CHECKING:
    from oarlock import Calibration
    from oarlock.cli.body import Body

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Calibrate mounts, lengths, biases, the magnetic field and clocks from a recording; which unit sits where.",
)
STATIC = "oarlock.calibration.static"
RECORDING = Option("recording", "Path", REQUIRED, "A recording folder.", True, "RECORDING")
BODY = Option("model", "Body", REQUIRED)
MODEL = Option("model", "SizedBody", REQUIRED)
OUT = Option("out", "NewFile", REQUIRED, "Calibration file to write.")


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    calibrate_session.add_to(group)
    _calibration_verb(
        "sagittal",
        f"{STATIC}.sagittal:calibrate_sagittal",
        calibrate_text.write_sagittal,
        "oarlock calibrate sagittal rec --model lower_body --stature-m 1.78 --mass-kg 74 --out cal.toml",
        "oarlock calibrate sagittal rec --model lower_body --still-s 0 2 --out cal.toml",
        body=BODY,
    )
    _calibration_verb(
        "chain",
        f"{STATIC}.hinge_chain:calibrate_hinge_chain",
        calibrate_text.write_chain,
        "oarlock calibrate chain rec --model pendulum3 --out cal.toml",
        "oarlock calibrate chain rec --model my.toml --still-s 0.5 3 --rest-q knee=0.4 --out cal.toml",
    )
    _calibration_verb(
        "pose",
        f"{STATIC}.pose_mounts:calibrate_pose",
        calibrate_text.write_pose,
        "oarlock calibrate pose rec --model my.toml --out cal.toml",
    )
    _calibration_verb(
        "axes",
        f"{STATIC}.hinge_axes:calibrate_hinge_axes",
        calibrate_text.write_axes,
        "oarlock calibrate axes rec --model my.toml --calibration cal.toml --out cal2.toml",
    )
    _calibration_verb(
        "joints",
        f"{STATIC}.joint_centers:calibrate_joint_centers",
        calibrate_text.write_joints,
        "oarlock calibrate joints rec --model my.toml --window-s 0.3 --out cal.toml",
    )
    _calibration_verb(
        "field",
        f"{STATIC}.local_field:calibrate_field",
        calibrate_text.write_field,
        "oarlock calibrate field rec --model my.toml --out cal.toml",
    )
    _calibration_verb(
        "clocks",
        "oarlock.calibration.clocks.calibrate:calibrate_clocks",
        calibrate_text.write_clocks,
        "oarlock calibrate clocks rec --model sculler --out cal.toml",
        "oarlock calibrate clocks rec --model my.toml --reference encoder --out cal.toml",
    )
    _calibration_verb(
        "motion",
        "oarlock.calibration.motion.calibrate:calibrate_motion",
        calibrate_text.write_motion,
        "oarlock calibrate motion rec --model sculler --out cal.toml",
        "oarlock calibrate motion rec --model sculler --calibration stature.toml --end-s 60 --out cal.toml",
    )
    command(
        group,
        "oarlock calibrate stature 1.84 --model sculler --out stature.toml",
        metavars={"stature_m": "METRES"},
    )(stature)
    calibrate_units.add_to(group)
    calibrate_video.add_to(group)
    app.add_typer(group, name="calibrate")


@dataclass(frozen=True)
class WrittenCalibration:
    """A calibration, its file, and the commands that use it."""

    calibration: Calibration
    file: Path
    next: list[str]

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        own = self.calibration
        clocks = {stream: vars(clock) for stream, clock in own.clocks.items()}
        values = {"parameters": own.parameters, "clocks": clocks, "noted": own.noted}
        return {"calibration": self.file, **values, "next": self.next}


def _calibration_verb(
    name: str, place: str, show: Callable[[Calibration], None], *examples: str, body: Option = MODEL
) -> None:
    """Adds the verb of a public function of a model and a recording that returns a calibration."""
    text = FunctionText.at(place)
    own = text.only(without=("model", "recording", "sensors") if body is BODY else ("model", "recording"))

    def calibrate(recording: Path, model: Body, out: Path, **arguments: Any) -> WrittenCalibration:
        import oarlock

        shown: AbstractContextManager[Any] = progress("calibrating")
        if any(option.name == "progress" for option in own):
            arguments["progress"], shown = True, nullcontext()
        with shown:
            calibration = text.load()(model.model, oarlock.load_recording(recording), **arguments)
        calibration.save(out)
        return WrittenCalibration(calibration, out, [track_next(recording, model.words, out, calibration)])

    def show_result(result: WrittenCalibration) -> None:
        say(f"Wrote {result.file}", style="bold")
        show(result.calibration)
        steps(*result.next)

    add_verb(
        group, name, replace(text, options=(RECORDING, body, OUT, *own)), calibrate, show_result, *examples
    )


def track_next(recording: Path, body: str, file: Path, calibration: Calibration) -> str:
    """The command that tracks with a calibration: of the same body, without streams that it left out."""
    from oarlock.pipeline import balls_of

    words = [body, f"--calibration {file}", *(f"--ball {','.join(pair)}" for pair in balls_of(calibration))]
    if calibration.noted.get("left_out"):
        words.append(f"--streams {','.join(calibration.mounts)}")
    return f"oarlock track {recording} {' '.join(words)} --out {recording}-track"


def stature(stature_m: float, *, model: ModelName, out: NewFile) -> dict[str, Any]:
    """Estimate a rower's segment lengths from stature, with standard deviations of 5 %.

    Args:
        stature_m: standing height without shoes, m.
        model: name of a shipped model, or a model file.
        out: calibration file to write.
    """
    import oarlock
    from oarlock.rowing import anthropometry

    lengths = anthropometry(oarlock.load_model(model), stature_m)
    lengths.save(out)
    return {
        "lengths": {
            name: {"length_m": length, "std_m": lengths.parameter_stds[name]}
            for name, length in lengths.parameters.items()
        },
        "noted": lengths.noted,
        "written": out,
        "next": [f"oarlock calibrate motion RECORDING --model {model} --calibration {out} --out cal.toml"],
    }
