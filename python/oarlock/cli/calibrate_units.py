"""`oarlock calibrate units`: finds which inertial unit sits where, from movements in a known order or by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.body import Sensors, chosen_body
from oarlock.cli.options import Json, ModelName, Replace, example
from oarlock.cli.terminal import UsageError, free_file, output_folder, print_json, say, steps, verb

if TYPE_CHECKING:
    from oarlock import Model, Recording


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "units",
        epilog=example(
            "oarlock calibrate units session.zip --model lower_body --order right_leg,left_leg",
            "oarlock calibrate units arm.csv --model arm --sensors thorax,upper_arm_r,forearm_r --order right_arm",
            "oarlock calibrate units rec --model full_body --units units.toml --write rec-named",
        ),
    )(units)


@verb
def units(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A recording folder, or files of any format of import.")
    ],
    model: ModelName,
    order: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Movements in order of time, comma-separated: right_arm, left_leg, right_knee, bow, nod, ...",
        ),
    ] = None,
    sensors: Sensors = None,
    units_file: Annotated[
        Path | None,
        typer.Option("--units", metavar="FILE", help="Take the assignment of this units.toml instead."),
    ] = None,
    from_s: Annotated[
        float, typer.Option("--from-s", metavar="S", help="Ignore movements before this time, s.")
    ] = -math.inf,
    to_s: Annotated[
        float, typer.Option("--until-s", metavar="S", help="Ignore movements after this time, s.")
    ] = math.inf,
    pick: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which recording, if the place has several.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="File to write; default: units.toml beside the files."
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Also write the recording with its units named as the sensors."),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Find which unit sits where, and write units.toml.

    Rest for two seconds, make the first movement four times without a pause, rest, make the next. Units that turn
    together are on one limb; the one further from the joint accelerates more. Without --order a terminal asks.
    """
    from oarlock.cli.unit_options import save_units
    from oarlock.recording.unit_names import UNITS_FILE, with_unit_names

    if order is not None and units_file is not None:
        raise UsageError("--order and --units contradict each other")
    worn = chosen_body(model, {}, sensors=sensors)
    recording = _read(path, pick)
    file = out or (path.parent if path.is_file() or _is_recording(path) else path) / UNITS_FILE
    if units_file is None:
        free_file(file, force)
    found, told = _assignment(recording, worn, order, units_file, (from_s, to_s), json_output)
    if units_file is None:
        save_units(found, file)
    if write is not None:
        named, _ = with_unit_names(recording, list(found), by_hand=found)
        with output_folder(write, "recording", force) as stage:
            named.save(stage)
    if json_output:
        print_json({"units": found, "file": units_file or file, "recording": write, **told})
        return
    say(
        f"Wrote {', '.join(str(p) for p in (None if units_file else file, write) if p is not None)}",
        style="bold",
    )
    if write is not None:
        steps(f"oarlock track {write} --model {model} --out {write}-track")
    elif not _is_recording(path):
        steps(f"oarlock import {path} --model {model} --units {file}")
    else:
        steps(f"oarlock calibrate units {path} --model {model} --units {file} --write {path}-named")


def _assignment(
    recording: Recording,
    body: Model,
    order: str | None,
    units_file: Path | None,
    within_s: tuple[float, float],
    json_output: bool,
) -> tuple[dict[str, str], dict[str, object]]:
    """Sensor -> stream, and what `--json` says about how it was found."""
    from oarlock.cli.import_path import asks_questions
    from oarlock.cli.unit_options import asked_units, write_assignment
    from oarlock.recording.unit_names import read_units_file, with_unit_names

    sensors = [sensor.name for sensor in body.describe().inertial_units]
    if units_file is not None:
        _, named = with_unit_names(recording, sensors, ids=read_units_file(units_file))
        return dict(named.units), {}
    if order is None:
        if not asks_questions(False, json_output):
            raise UsageError("give --order, the movements in order of time, such as right_arm,left_arm,bow")
        return asked_units(recording, body), {}
    from oarlock.calibration.assignment.assign import assign_by_movement

    found = assign_by_movement(body, recording, order, *within_s)
    if not json_output:
        write_assignment(found)
    movements = [{"name": name, "start_s": start, "end_s": end} for name, start, end in found.movements]
    return dict(found.units), {
        "movements": movements,
        "shares": found.shares,
        "distances_m": found.levers_m,
    }


def _is_recording(path: Path) -> bool:
    return (path / "recording.toml").is_file()


def _read(path: Path, pick: str | None) -> Recording:
    import oarlock

    return oarlock.load_recording(path) if _is_recording(path) else oarlock.import_recording(path, pick)
