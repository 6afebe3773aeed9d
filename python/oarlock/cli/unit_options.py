"""Options that name the inertial units of a recording as the sensors of a model. For `oarlock import PATH`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.terminal import UsageError, say, table

if TYPE_CHECKING:
    from oarlock import Recording
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
        from oarlock.cli.calibrate_units import asked_units, save_units

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
    from oarlock.recording.unit_names import UNITS_FILE, units_of

    model, texts = options.pop("model", None), options.pop("units", None)
    by_hand, ids = units_of(assignment(texts), path)
    sensors = None
    if model is not None:
        from oarlock import load_model

        sensors = [sensor.name for sensor in load_model(model).describe().inertial_units]
    beside = (path if path.is_dir() else path.parent) / UNITS_FILE
    return Naming(model or "", sensors, by_hand, ids, beside)
