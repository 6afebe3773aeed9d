"""`oarlock model`: lists, shows, checks and copies model files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.terminal import UsageError, say, steps, table
from oarlock.cli.verbs import Incomplete, ModelName, NewFile, command

if TYPE_CHECKING:
    from oarlock.cli.body import Body
    from oarlock.model.description import ModelDescription
    from oarlock.report.pose_picture.skeleton import StickFigure

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Show, check and copy model files.")


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="model")


def _show_list(models: list[dict[str, Any]]) -> None:
    table(
        ["model", ">joints", ">sensors", "description"],
        [(m["name"], len(m["joints"]), len(m["sensors"]), m["description"]) for m in models],
        indent=0,
    )
    steps("oarlock model show sculler", "oarlock model copy sculler my.toml")


@command(group, "oarlock model list", "oarlock model list --json", name="list", show=_show_list)
def list_() -> list[dict[str, Any]]:
    """The models that come with oarlock."""
    from oarlock import load_model
    from oarlock.model.shipped_files import model_names, model_path

    models = [(name, load_model(name).describe()) for name in model_names()]
    return [
        {
            "name": description.name,
            "description": description.description,
            "joints": [joint.name for joint in description.joints],
            "coordinates": [name for joint in description.joints for name in joint.coordinates],
            "sensors": [sensor.name for sensor in description.sensors],
            "path": model_path(name),
        }
        for name, description in models
    ]


@dataclass(frozen=True)
class ModelSheet:
    """A model, its figure in a pose, the values that set the pose, and the picture that was written."""

    description: ModelDescription
    figure: StickFigure
    at: dict[str, float]
    svg: Path | None

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self.description.to_dict()


def _show_model(sheet: ModelSheet) -> None:
    from oarlock.cli import model_sheet

    model_sheet.write(sheet.description)
    model_sheet.write_pose(sheet.figure, [f"{name}={value:g}" for name, value in sheet.at.items()])
    if sheet.svg is not None:
        say(f"\nPose written to {sheet.svg}")


@command(
    group,
    "oarlock model show sculler",
    "oarlock model show my.toml --svg pose.svg",
    "oarlock model show sculler --set l_ua_r=0.31 --at seat=0.3 --at trunk=-0.4",
    "oarlock model show full_body --stature-m 1.78 --mass-kg 74 --sensors pelvis,thigh_r,shank_r",
    "oarlock model show sculler --json | jq .measurement_names",
    show=_show_model,
    metavars={"at": "JOINT=VALUE"},
)
def show(model: Body, *, svg: NewFile | None = None, at: dict[str, float] | None = None) -> ModelSheet:
    """Frames, joints, sensors, parameters, layout of state and measurement, and where the frames are in a pose.

    Args:
        model: the body.
        svg: also write the drawn pose as SVG.
        at: value of a joint, or of a ball's coordinate such as hip.rx (rad or m); else at rest. Repeatable.
    """
    from oarlock.report.pose_picture.skeleton import skeleton
    from oarlock.report.pose_picture.svg import draw_svg
    from oarlock.storage.write_file import write_file

    values = at or {}
    description = model.model.describe()
    figure = skeleton(model.model, posture(description, values, "--at"))
    if svg is not None:
        write_file(svg, draw_svg(figure, description.name))
    return ModelSheet(description, figure, values, svg)


def posture(description: ModelDescription, values: dict[str, float], flag: str) -> list[float]:
    """Values of the coordinates (n_coordinates,): these; the others at rest.

    Raises:
        UsageError: a name is no coordinate of the model.
    """
    from oarlock.storage.suggest import did_you_mean

    resting: dict[str, float] = {}
    for joint in description.joints:
        rest = joint.rest if isinstance(joint.rest, tuple) else (joint.rest,)
        resting |= dict(zip(joint.coordinates, rest, strict=True))
    several = {joint.name: joint.coordinates for joint in description.joints}
    for name in values:
        if name not in resting and name in several:
            raise UsageError(
                f"{flag} {name}: this joint has several coordinates: {', '.join(several[name])}."
            )
        if name not in resting:
            raise UsageError(f"{flag} {name}: the model has no such joint. {did_you_mean(name, resting)}")
    return [values.get(name, rest) for name, rest in resting.items()]


def _show_checked(result: dict[str, Any]) -> None:
    if result["ok"]:
        say(f"{result['path']}: fine", style="bold")
        for line in result["checked"]:
            say(line, indent=2)


@command(group, "oarlock model check my.toml", "oarlock model check my.toml --json", show=_show_checked)
def check(model: ModelName) -> dict[str, Any]:
    """Read a model file and explain every mistake in it, or list what was checked.

    Args:
        model: name of a shipped model, or a model file.
    """
    from oarlock import ModelError, load_model
    from oarlock.cli import model_sheet

    try:
        loaded = load_model(model)
    except ModelError as error:
        mistakes = [line.strip() for line in str(error).splitlines() if line.strip()] or ["(no message)"]
        count = "1 mistake" if len(mistakes) == 1 else f"{len(mistakes)} mistakes"
        message = "\n".join([f"{count} in {model}", *mistakes])
        raise Incomplete({"model": model, "ok": False, "mistakes": mistakes}, message) from None
    checked = model_sheet.checked(loaded)
    return {"model": model, "path": loaded.path, "ok": True, "mistakes": [], "checked": checked}


@command(
    group,
    "oarlock model copy sculler my.toml",
    "oarlock model copy arm7 my.toml --force",
    metavars={"name": "NAME"},
)
def copy(name: str, file: NewFile) -> dict[str, Any]:
    """Copy a shipped model to a file that you can edit.

    Args:
        name: name of a shipped model.
        file: the file to write, e.g. my.toml.
    """
    from oarlock.model.shipped_files import model_names, model_path
    from oarlock.storage.regular_file import read_text
    from oarlock.storage.suggest import did_you_mean
    from oarlock.storage.write_file import write_file

    if name not in model_names():
        raise UsageError(f"no shipped model is called '{name}'. {did_you_mean(name, model_names())}")
    write_file(file, read_text(model_path(name)))
    return {
        "model": name,
        "written": file,
        "next": [
            f"edit {file}                 change lengths, sensors and joints",
            f"oarlock model check {file}",
            f"oarlock track RECORDING --model {file} --out out",
        ],
    }
