"""`oarlock calibrate units`: which inertial unit sits where, from movements, by hand or by names; also for `import`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.show import show_document
from oarlock.cli.terminal import UsageError, asks_questions, free_file, output_folder, say
from oarlock.cli.verbs import ModelName, NewFolder, command, names

if TYPE_CHECKING:
    from oarlock import Model, Recording
    from oarlock.calibration.assignment.assign import MovementAssignment
    from oarlock.recording.streams import ImuStream


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    command(
        group,
        "oarlock calibrate units session.zip --model lower_body --order right_leg,left_leg",
        "oarlock calibrate units arm.csv --model arm --sensors thorax,upper_arm_r,forearm_r --order right_arm",
        "oarlock calibrate units rec --model full_body --units units.toml --write rec-named",
        metavars={"path": "PATH", "order": "NAMES"},
    )(units)


def units(
    path: Path,
    *,
    model: ModelName,
    order: str | None = None,
    sensors: tuple[str, ...] | None = None,
    units: Path | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    pick: str | None = None,
    out: Path | None = None,
    write: NewFolder | None = None,
    force: bool,
    json_output: bool,
) -> dict[str, Any]:
    """Find which unit sits where, and write units.toml.

    Rest for two seconds, make the first movement four times without a pause, rest, make the next. Units that turn
    together are on one limb; the one further from the joint accelerates more. Without --order a terminal asks.

    Args:
        path: a recording folder, or files of any format of import.
        model: name of a shipped model, or a model file.
        order: movements in order of time, comma-separated, such as right_arm,left_leg,right_knee,bow,nod.
        sensors: inertial units that are worn, comma-separated; the body is cut to what they measure.
        units: take the assignment of this units.toml instead.
        from_s: ignore movements before this time, s.
        until_s: ignore movements after this time, s.
        pick: which recording, if the place has several.
        out: file to write; default: units.toml beside the files.
        write: also write the recording with its units named as the sensors.
        force: replace what is there.
        json_output: ask nothing.
    """
    import oarlock
    from oarlock.calibration.assignment.assign import assign_by_movement
    from oarlock.cli.body import body_of
    from oarlock.recording.unit_names import UNITS_FILE, read_units_file, with_unit_names

    if order is not None and units is not None:
        raise UsageError("--order and --units contradict each other")
    if order is None and units is None and not asks_questions(False, json_output):
        raise UsageError("give --order, the movements in order of time, such as right_arm,left_arm,bow")
    is_ours = (path / "recording.toml").is_file()
    file = out or (path.parent if path.is_file() or is_ours else path) / UNITS_FILE
    if units is None:
        free_file(file, force)
    body = body_of(model=model, sensors=sensors).model
    recording = oarlock.load_recording(path) if is_ours else oarlock.import_recording(path, pick)
    result: dict[str, Any] = {}
    if units is not None:
        wanted = [sensor.name for sensor in body.describe().inertial_units]
        assignment = with_unit_names(recording, wanted, ids=read_units_file(units))[1].units
    elif order is None:
        assignment = asked_units(recording, body)
    else:
        within_s = (-math.inf if from_s is None else from_s, math.inf if until_s is None else until_s)
        found = assign_by_movement(body, recording, order, *within_s)
        result, assignment = evidence(found), found.units
    if units is None:
        save_units(assignment, file)
    if write is not None:
        named, _ = with_unit_names(recording, list(assignment), by_hand=assignment)
        with output_folder(write, "recording", force) as stage:
            named.save(stage)
    step = f"oarlock calibrate units {path} --model {model} --units {units or file} --write {path}-named"
    if write is not None:
        step = f"oarlock track {write} --model {model} --out {write}-track"
    elif not is_ours:
        step = f"oarlock import {path} --model {model} --units {units or file}"
    return {
        "units": {sensor: {"unit": stream} for sensor, stream in assignment.items()},
        **result,
        "written": [place for place in (None if units else file, write) if place is not None],
        "next": [step],
    }


def assignment(texts: list[str] | None) -> dict[str, str] | Path | None:
    """What `--units` says.

    Raises:
        UsageError: it cannot be understood.
    """
    from oarlock.recording.unit_names import parsed_units
    from oarlock.storage.errors import DataError

    try:
        return parsed_units(texts)
    except DataError as error:
        raise UsageError(str(error)) from None


def named_units(
    recording: Recording,
    body: Model | None,
    units: tuple[Mapping[str, str], Mapping[str, str]],
    path: Path,
    asks: bool,
) -> tuple[Recording, dict[str, Any]]:
    """The recording with its units named, and the assignment; unchanged without a model and an assignment.

    If no name says anything, the person at the terminal is asked, and `units.toml` is written.

    Args:
        recording: with any names.
        body: whose sensors they are.
        units: as `units_of` gives them.
        path: the recording's file or folder.
        asks: whether a person sits at the terminal.
    """
    from oarlock.recording.unit_names import UNITS_FILE, with_unit_names
    from oarlock.storage.errors import DataError

    by_hand, ids = units
    if body is None and not by_hand and not ids:
        return recording, {}
    sensors = None if body is None else [sensor.name for sensor in body.describe().inertial_units]
    try:
        named, assignment = with_unit_names(recording, sensors, by_hand, ids)
    except DataError as error:
        if not asks or body is None or by_hand:
            raise
        say(str(error))
        by_hand = asked_units(recording, body)
        named, assignment = with_unit_names(recording, sensors, by_hand)
        beside = (path if path.is_dir() else path.parent) / UNITS_FILE
        if not beside.exists() and typer.confirm(f"  write {beside} for the next time?", default=True):
            save_units(by_hand, beside)
    rows = {s: {"unit": u, "reason": assignment.reasons[s]} for s, u in assignment.units.items()}
    return named, {"units": rows, "unused_units": assignment.unused, "free_sensors": assignment.free}


def asked_units(recording: Recording, body: Model) -> dict[str, str]:
    """Sensor -> stream, as the person at the terminal says."""
    show_document([_turns(stream) for stream in _inertial(recording)])
    sensors = [sensor.name for sensor in body.describe().inertial_units]
    say(f"Which unit is which of {', '.join(sensors)}?")
    say("movement: the recording contains movements in an order that you know", indent=2)
    say("hand: you name the unit of each sensor", indent=2)
    while (way := str(typer.prompt("  movement or hand"))) not in ("movement", "hand"):
        say(f'"{way}" is neither', indent=2)
    return _by_hand(recording, sensors) if way == "hand" else _by_movement(recording, body)


def evidence(found: MovementAssignment) -> dict[str, Any]:
    """Units by sensor, with their share of the largest turn in each movement and their distance from the joint."""
    names = [name for name, *_ in found.movements]
    units = {
        sensor: {
            "unit": stream,
            **{
                f"{name}_percent": 100.0 * share
                for name, share in zip(names, found.shares[stream], strict=True)
            },
            "distance_m": found.levers_m.get(stream),
        }
        for sensor, stream in found.units.items()
    }
    return {
        "units": units,
        "movements": [{"name": name, "start_s": start, "end_s": end} for name, start, end in found.movements],
        "notes": [
            "A percentage is the share of the largest turn in a movement; a distance is that from its joint.",
            "Right and left are as the order says. `oarlock track` names units that appear to be exchanged.",
        ],
    }


def save_units(units: Mapping[str, str], file: Path) -> None:
    """Writes `units.toml`: stream = sensor."""
    from oarlock.storage.toml import write_toml

    write_toml(file, {"units": {stream: sensor for sensor, stream in units.items()}})


def _inertial(recording: Recording) -> list[ImuStream]:
    from oarlock.recording import ImuStream

    return [stream for stream in recording.streams if isinstance(stream, ImuStream)]


def _turns(stream: ImuStream) -> dict[str, object]:
    """How much a unit turned, and when most."""
    import numpy as np

    row: dict[str, object] = {"unit": stream.name, "rate_hz": stream.rate_hz}
    if stream.gyro_rad_s is None or not len(stream):
        return row
    rate = np.linalg.norm(np.nan_to_num(stream.gyro_rad_s), axis=1)
    turned = float(np.trapezoid(rate, stream.time_s)) / (2.0 * np.pi)
    return {**row, "full_turns": turned, "fastest_at_s": float(stream.time_s[int(np.argmax(rate))])}


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
        show_document(evidence(found))
        return dict(found.units)
