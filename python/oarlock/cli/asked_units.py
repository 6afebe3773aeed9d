"""Questions on a terminal about which unit sits where: by movement, or by hand with a table. For import and assign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import typer

from oarlock.cli.terminal import number, say, table

if TYPE_CHECKING:
    from oarlock import Model, Recording
    from oarlock.calibration.assignment.assign import MovementAssignment
    from oarlock.recording.streams import ImuStream


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
