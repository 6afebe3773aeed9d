"""Options that name the inertial units of a recording as the sensors of a model. For `oarlock import PATH`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.terminal import UsageError, number, say, table

if TYPE_CHECKING:
    from oarlock import Model, Recording
    from oarlock.calibration.assignment.assign import MovementAssignment
    from oarlock.recording.streams import ImuStream
    from oarlock.recording.unit_names import Assignment

UnitsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--units",
        metavar="SENSOR=UNIT,...|FILE",
        help="Which unit sits where: its name or device id; or a units.toml. Default: units.toml beside the files, "
        "then names.",
    ),
]
UNIT_OPTIONS: list[tuple[str, Any, Any]] = [
    (
        "model",
        Annotated[
            str | None,
            typer.Option(
                metavar="NAME|FILE", help="Name the units as this model's sensors, by their own names."
            ),
        ],
        None,
    ),
    ("units", UnitsOption, None),
]
"""Name, annotation and default of each option."""


@dataclass
class Naming:
    """How the units of recordings are named.

    Args:
        model: name or file of the model; empty without one.
        sensors: names of its inertial units; None without a model.
        by_hand: sensor -> stream, or a part of its name.
        ids: device's id -> segment or sensor.
        beside: the `units.toml` beside the recordings, whether it exists or not.
        last: the assignment of the last recording.
    """

    model: str
    sensors: list[str] | None
    by_hand: dict[str, str]
    ids: dict[str, str]
    beside: Path
    last: Assignment | None = field(default=None)

    def named(self, recording: Recording) -> Recording:
        """The recording with its units named; unchanged without an option."""
        from oarlock.recording.unit_names import with_unit_names

        if self.sensors is None and not self.by_hand and not self.ids:
            return recording
        found, self.last = with_unit_names(recording, self.sensors, self.by_hand, self.ids)
        return found

    def named_or_asked(self, recording: Recording, asks: bool) -> Recording:
        """As `named`; if no name says anything, the person at the terminal is asked and units.toml is written."""
        from oarlock.storage.errors import DataError

        try:
            return self.named(recording)
        except DataError as error:
            if not asks or not self.model or self.by_hand:
                raise
            say(str(error))
        from oarlock import load_model

        self.by_hand = asked_units(recording, load_model(self.model))
        self.ids = {}
        named = self.named(recording)
        if not self.beside.exists() and typer.confirm(
            f"  write {self.beside} for the next time?", default=True
        ):
            save_units(self.by_hand, self.beside)
        return named

    def document(self) -> dict[str, object]:
        """The assignment for `--json`; empty without one."""
        if self.last is None:
            return {}
        units = {s: {"unit": u, "reason": self.last.reasons[s]} for s, u in self.last.units.items()}
        return {"units": units, "unused_units": self.last.unused, "free_sensors": self.last.free}

    def say(self) -> None:
        """Prints which unit became which sensor and why."""
        if self.last is None:
            return
        table(
            ["sensor", "unit", "because of"],
            [(sensor, unit, self.last.reasons[sensor]) for sensor, unit in self.last.units.items()],
        )
        if self.last.unused:
            say(f"no sensor for {', '.join(self.last.unused)}", indent=2)
        if self.last.free:
            say(f"no unit for {', '.join(self.last.free)}", indent=2)


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


def taken_naming(options: dict[str, Any], path: Path) -> Naming:
    """The naming among the options of a verb, which are removed from them.

    Raises:
        UsageError: `--units` cannot be understood.
        DataError: the model or the file cannot be read.
    """
    model, texts = options.pop("model", None), options.pop("units", None)
    return naming_of(model, assignment(texts), path)


def naming_of(model: str | None, units: Mapping[str, str] | Path | None, path: Path) -> Naming:
    """The naming by a model and an assignment, or by the units.toml beside the recordings of a place."""
    from oarlock import load_model
    from oarlock.recording.unit_names import UNITS_FILE, units_of

    sensors = None
    if model is not None:
        sensors = [sensor.name for sensor in load_model(model).describe().inertial_units]
    beside = (path if path.is_dir() else path.parent) / UNITS_FILE
    return Naming(model or "", sensors, *units_of(units, path), beside)


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
    import numpy as np

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
