"""`oarlock calibrate units`: finds which inertial unit sits where, from movements in a known order or by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from oarlock.cli.body import Sensors, chosen_body
from oarlock.cli.options import Json, ModelName, Replace, example
from oarlock.cli.terminal import (
    UsageError,
    free_file,
    number,
    output_folder,
    print_json,
    say,
    steps,
    table,
    verb,
)

if TYPE_CHECKING:
    from oarlock import Model, Recording
    from oarlock.calibration.assignment.assign import MovementAssignment
    from oarlock.recording.streams import ImuStream


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


def asked_units(recording: Recording, body: Model) -> dict[str, str]:
    """Sensor -> stream, as the person at the terminal says."""
    write_units(recording)
    sensors = [sensor.name for sensor in body.describe().inertial_units]
    say(f"Which unit is which of {', '.join(sensors)}?")
    say("movement: the recording contains movements in an order that you know", indent=2)
    say("hand: you name the unit of each sensor", indent=2)
    while (way := str(typer.prompt("  movement or hand"))) not in ("movement", "hand"):
        say(f'"{way}" is neither', indent=2)
    return _by_hand(recording, sensors) if way == "hand" else _by_movement(recording, body)


def write_units(recording: Recording) -> None:
    """Prints a table of the inertial units: how much each turned, and when most."""
    rows = []
    for stream in _inertial(recording):
        rate = (
            np.linalg.norm(np.nan_to_num(stream.gyro_rad_s), axis=1)
            if stream.gyro_rad_s is not None
            else None
        )
        turned = None if rate is None else float(np.trapezoid(rate, stream.time_s)) / (2.0 * np.pi)
        most = None if rate is None or not len(rate) else float(stream.time_s[int(np.argmax(rate))])
        rows.append((stream.name, number(stream.rate_hz, ".0f"), number(turned, ".1f"), number(most, ".1f")))
    table(["unit", ">Hz", ">turned, full turns", ">fastest at s"], rows)


def write_assignment(found: MovementAssignment) -> None:
    """Prints each sensor with its unit and the numbers that say so."""
    streams = [found.units[sensor] for sensor in found.units]
    names = [name for name, *_ in found.movements]
    table(
        ["movement", ">from s", ">to s"],
        [(name, f"{start:.1f}", f"{end:.1f}") for name, start, end in found.movements],
    )
    say("Share of the largest turn in each movement, and the distance from the joint:")
    rows = [
        (
            sensor,
            stream,
            *(f"{100 * share:.0f} %" for share in found.shares[stream]),
            f"{100 * found.levers_m[stream]:.0f} cm" if stream in found.levers_m else "",
        )
        for sensor, stream in zip(found.units, streams, strict=True)
    ]
    table(["sensor", "unit", *(f">{name}" for name in names), ">distance"], rows)
    say("Right and left are as the order says. `oarlock track` names units that appear to be exchanged.")


def save_units(units: Mapping[str, str], file: Path) -> None:
    """Writes `units.toml`: stream = sensor."""
    from oarlock.storage.toml import write_toml

    write_toml(file, {"units": {stream: sensor for sensor, stream in units.items()}})


def _inertial(recording: Recording) -> list[ImuStream]:
    from oarlock import ImuStream

    return [stream for stream in recording.streams if isinstance(stream, ImuStream)]


def _by_hand(recording: Recording, sensors: Sequence[str]) -> dict[str, str]:
    free = [stream.name for stream in _inertial(recording)]
    found: dict[str, str] = {}
    say("Name the unit of each sensor, or a part of its name; Enter: not worn.")
    for sensor in sensors:
        while free:
            answer = str(typer.prompt(f"  {sensor}", default="", show_default=False)).strip()
            fits = [n for n in free if n == answer] or [n for n in free if answer.casefold() in n.casefold()]
            if answer and len(fits) != 1:
                say(f'"{answer}" is {"several" if fits else "none"} of {", ".join(free)}', indent=2)
                continue
            if answer:
                found[sensor] = fits[0]
                free.remove(fits[0])
            break
    return found


def _by_movement(recording: Recording, body: Model) -> dict[str, str]:
    from oarlock.calibration.assignment.assign import assign_by_movement
    from oarlock.calibration.assignment.movements import MOVEMENTS
    from oarlock.cli.options import names
    from oarlock.storage.errors import DataError, ModelError

    for movement in MOVEMENTS.values():
        say(f"{movement.name}: {movement.say}", indent=2)
    while True:
        try:
            worn = body
            if len(_inertial(recording)) != len(body.describe().inertial_units):
                worn = body.with_units(names(str(typer.prompt("  sensors that are worn, comma-separated"))))
            order = str(typer.prompt("  movements in order of time, comma-separated"))
            found = assign_by_movement(worn, recording, order)
        except (DataError, ModelError) as error:
            say(str(error))
            continue
        write_assignment(found)
        return dict(found.units)
