"""The options of all readers as options of `oarlock import PATH`, which knows the format only when it has looked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from oarlock.cli.options import metavar_of
from oarlock.cli.terminal import UsageError
from oarlock.formats.importers import FORMATS


def reader_options() -> list[tuple[str, Any, Any]]:
    """Name, annotation and default of each option that a reader has and that need not be given."""
    found: dict[str, tuple[str, Any, Any]] = {}
    for one in (option for format in FORMATS for option in format.options if option.default is not ...):
        owners = ", ".join(_owners(one.name))
        kind: Any = bool if one.kind is bool else one.kind | None  # type: ignore[operator]
        option = typer.Option(
            metavar=metavar_of(one.name, one.kind), help=f"{one.about.rstrip('.')} ({owners})."
        )
        found.setdefault(one.name, (one.name, Annotated[kind, option], False if kind is bool else None))
    return list(found.values())


def taken_reading(options: dict[str, Any]) -> dict[str, object]:
    """The readers' options among those of the verb, which are removed from them; only those that were given."""
    values = {name: options.pop(name) for name, _, _ in reader_options()}
    return {name: value for name, value in values.items() if value is not None and value is not False}


def of_format(reading: Mapping[str, object], format: str) -> dict[str, object]:
    """Those that a format has."""
    return {name: value for name, value in reading.items() if format in _owners(name)}


def refuse_others(reading: Mapping[str, object], format: str) -> None:
    """Refuse an option that the format does not have.

    Raises:
        UsageError: names the option and the formats that have it.
    """
    for name in reading:
        if format not in _owners(name):
            flag = f"--{name.replace('_', '-')}"
            owners = _owners(name)
            raise UsageError(
                f"{flag}: the format {format} has no such option "
                f"({', '.join(owners)} {'has' if len(owners) == 1 else 'have'} it)"
            )


def _owners(name: str) -> list[str]:
    return [one.name for one in FORMATS if any(option.name == name for option in one.options)]
