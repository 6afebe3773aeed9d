"""`oarlock model`: lists, shows, checks and copies model files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from oarlock.cli.body import Mass, Sensors, Stature, chosen_body
from oarlock.cli.options import Json, Replace, Settings, assignments, example
from oarlock.cli.terminal import EXIT_DATA, UsageError, free_file, page, print_json, say, steps, table, verb
from oarlock.model.description import ModelDescription

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Show, check and copy model files.")

Named = Annotated[str, typer.Argument(metavar="NAME|FILE", help="Name of a shipped model, or a model file.")]


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="model")


@group.command("list", epilog=example("oarlock model list", "oarlock model list --json"))
@verb
def list_(json_output: Json = False) -> None:
    """The models that come with oarlock."""
    from oarlock import load_model
    from oarlock.model.shipped_files import model_names, model_path

    models = [(name, load_model(name).describe()) for name in model_names()]
    if json_output:
        print_json([{**_short(description), "path": model_path(name)} for name, description in models])
        return
    table(
        ["model", ">joints", ">frames", ">sensors", "description"],
        [(name, len(d.joints), len(d.frames) - 1, len(d.sensors), d.description) for name, d in models],
        indent=0,
    )
    steps("oarlock model show sculler", "oarlock model copy sculler my.toml")


def _short(description: ModelDescription) -> dict[str, Any]:
    return {
        "name": description.name,
        "description": description.description,
        "joints": [joint.name for joint in description.joints],
        "coordinates": [name for joint in description.joints for name in joint.coordinates],
        "sensors": [sensor.name for sensor in description.sensors],
    }


@group.command(
    "show",
    epilog=example(
        "oarlock model show sculler",
        "oarlock model show my.toml --svg pose.svg",
        "oarlock model show sculler --set l_ua_r=0.31 --at seat=0.3 --at trunk=-0.4",
        "oarlock model show full_body --stature-m 1.78 --mass-kg 74 --sensors pelvis,thigh_r,shank_r",
        "oarlock model show sculler --json | jq .measurement_names",
    ),
)
@verb
def show(
    model: Named,
    svg: Annotated[
        Path | None, typer.Option("--svg", metavar="FILE", help="Also write the drawn pose as SVG.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="JOINT=VALUE",
            help="Value of a joint, or of a ball's coordinate such as hip.rx (rad or m); else at rest. Repeatable.",
        ),
    ] = None,
    settings: Settings = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    sensors: Sensors = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Frames, joints, sensors, parameters, layout of state and measurement, and where the frames are in a pose."""
    from oarlock.cli import model_sheet
    from oarlock.report.pose_picture.skeleton import skeleton
    from oarlock.report.pose_picture.svg import draw_svg
    from oarlock.storage.write_file import write_file

    if svg is not None:
        free_file(svg, force)
    loaded = chosen_body(model, assignments(settings, "--set"), stature_m, mass_kg, sensors)
    description = loaded.describe()
    body = skeleton(loaded, posture(description, assignments(at, "--at"), "--at"))
    if svg is not None:
        write_file(svg, draw_svg(body, description.name))
    if json_output:
        print_json(description.to_dict())
        return
    model_sheet.write(description)
    model_sheet.write_pose(body, at or [])
    if svg is not None:
        say(f"\nPose written to {svg}")


def posture(description: ModelDescription, given: dict[str, float], flag: str) -> list[float]:
    """Values of the coordinates (n_coordinates,): the given ones; the others at rest.

    Raises:
        UsageError: a name is no coordinate of the model.
    """
    resting: dict[str, float] = {}
    for joint in description.joints:
        rest = joint.rest if isinstance(joint.rest, tuple) else (joint.rest,)
        resting |= dict(zip(joint.coordinates, rest, strict=True))
    several = {joint.name: joint.coordinates for joint in description.joints}
    for name in given:
        if name not in resting and name in several:
            raise UsageError(
                f"{flag} {name}: this joint has several coordinates: {', '.join(several[name])}."
            )
        if name not in resting:
            from oarlock.storage.suggest import did_you_mean

            raise UsageError(f"{flag} {name}: the model has no such joint. {did_you_mean(name, resting)}")
    return [given.get(name, rest) for name, rest in resting.items()]


@group.command("check", epilog=example("oarlock model check my.toml", "oarlock model check my.toml --json"))
@verb
def check(model: Named, json_output: Json = False) -> None:
    """Read a model file and explain every mistake in it, or list what was checked."""
    from oarlock import ModelError, load_model

    try:
        description = load_model(model).describe()
    except ModelError as error:
        mistakes = [line.strip() for line in str(error).splitlines() if line.strip()] or ["(no message)"]
        if json_output:
            print_json({"model": model, "ok": False, "mistakes": mistakes})
        count = "1 mistake" if len(mistakes) == 1 else f"{len(mistakes)} mistakes"
        console = page(stderr=True)
        console.print(f"[bold red]error:[/] {count} in", model, soft_wrap=True)
        for mistake in mistakes:
            console.print(f"  {mistake}", markup=False, soft_wrap=True)
        raise typer.Exit(EXIT_DATA) from None
    from oarlock.cli import model_sheet

    checked = model_sheet.checked(description)
    if json_output:
        print_json({"model": model, "ok": True, "mistakes": [], "checked": checked})
        return
    say(f"{description.path}: fine", style="bold")
    for line in checked:
        say(line, indent=2)


@group.command(
    "copy", epilog=example("oarlock model copy sculler my.toml", "oarlock model copy arm7 my.toml --force")
)
@verb
def copy(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of a shipped model.")],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write, e.g. my.toml.")],
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file if it exists.")] = False,
    json_output: Json = False,
) -> None:
    """Copy a shipped model to a file that you can edit."""
    from oarlock.model.shipped_files import model_names, model_path
    from oarlock.storage.regular_file import read_text
    from oarlock.storage.suggest import did_you_mean
    from oarlock.storage.write_file import write_file

    if name not in model_names():
        raise UsageError(f"no shipped model is called '{name}'. {did_you_mean(name, model_names())}")
    free_file(file, force)
    write_file(file, read_text(model_path(name)))
    if json_output:
        print_json({"model": name, "written": file})
        return
    say(f"Wrote {file}, a copy of {name}.")
    steps(
        f"edit {file}                 change lengths, sensors and joints",
        f"oarlock model check {file}",
        f"oarlock track RECORDING --model {file} --out out",
    )
