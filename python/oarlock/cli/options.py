"""Command-line options that several verbs share, and the parsers of their texts."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from oarlock.cli.terminal import UsageError

ModelName = Annotated[
    str, typer.Option("--model", "-m", metavar="NAME|FILE", help="Name of a shipped model, or a model file.")
]
OutFile = Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Calibration file to write.")]
OutFolder = Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER", help="Folder to write.")]
Json = Annotated[bool, typer.Option("--json", help="Print only one JSON document, on stdout.")]
Force = Annotated[bool, typer.Option("--force", help="Replace what is there; other files stay.")]
CalibrationFile = Annotated[
    Path | None,
    typer.Option("--calibration", metavar="FILE", help="Calibration file with mounts and lengths."),
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", metavar="N", min=1, help="Parallel processes; default: all cores.")
]
Replace = Annotated[bool, typer.Option("--force", help="Replace a file that exists.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A model parameter, e.g. l_ua_r=0.31 (SI). Repeatable."),
]


UNITS = {
    "_s": "S",
    "_hz": "HZ",
    "_m": "M",
    "_kg": "KG",
    "_rad": "RAD",
    "_deg": "DEG",
    "_spm": "SPM",
    "_ut": "UT",
}


def metavar_of(name: str, kind: Any) -> str | None:
    """Placeholder of a value in the help: the unit at the end of the name, else by type; None for a flag."""
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), None)
    return unit or {float: "X", int: "N", str: "NAME", Path: "FILE"}.get(kind)


def example(*commands: str) -> str:
    """End of a help text: example commands."""
    return "\b\nExamples:\n" + "\n".join(f"  {command}" for command in commands)


def assignments(
    texts: Iterable[str] | None, flag: str, sample: str = "l_ua_r=0.31", unit: str = "SI units: m, rad"
) -> dict[str, float]:
    """`["l_ua_r=0.31"]` as `{"l_ua_r": 0.31}`; `sample` and `unit` are for the error messages.

    Raises:
        UsageError: a text is not NAME=NUMBER, or a name comes twice.
    """
    found: dict[str, float] = {}
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals):
            raise UsageError(f"{flag} {text}: expected NAME=VALUE, for example {flag} {sample}")
        if name in found:
            raise UsageError(f"{flag}: {name} is given twice")
        try:
            found[name] = float(value)
        except ValueError:
            raise UsageError(f"{flag} {text}: '{value}' is not a number ({unit})") from None
    return found


def names(text: str) -> tuple[str, ...]:
    """`"gyro_bias,surge"` as `("gyro_bias", "surge")`; an empty text or `none` as `()`."""
    return tuple(name for part in text.split(",") if (name := part.strip()) and name != "none")
