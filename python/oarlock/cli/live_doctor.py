"""`oarlock live doctor`: says why nothing comes from the sensors, and what to try."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.live_scan import LookSeconds, timed
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import EXIT_DATA, checklist, heading, print_json, progress, say, steps, verb

if TYPE_CHECKING:
    from oarlock.live.doctor.check import Diagnosis


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "doctor",
        epilog=example("oarlock live doctor", "oarlock live doctor rig.toml --duration-s 20 --out today"),
    )(doctor)


@verb
def doctor(
    rig: Annotated[
        Path | None,
        typer.Argument(metavar="RIG", help="A rig file; its sources are opened for some seconds."),
    ] = None,
    seconds: LookSeconds = 5.0,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="FOLDER", help="Where you will record: room and speed are tried there."
        ),
    ] = Path(),
    json_output: Json = False,
) -> None:
    """Say why nothing comes from the sensors, and what to try.

    Without RIG it looks at this machine: versions, network, ports, firewall, permissions, clock and disk. With it, each
    source is opened, and you see which stream gets what. The exit status is 1 if something prevents a session.
    """
    from oarlock.live.doctor.check import PROBLEM
    from oarlock.live.doctor.doctor import arrival_checks, machine_checks, read_rig

    setup, model, about_rig = (None, None, []) if rig is None else read_rig(rig)
    machine = asyncio.run(machine_checks(setup, out))
    if setup is not None and model is not None:
        with progress("listening") as told:
            about_rig += asyncio.run(timed(arrival_checks(setup, model, seconds), seconds, told))
    checks = [*machine, *about_rig]
    problems = [check for check in checks if check.state == PROBLEM]
    if json_output:
        print_json({"checks": checks, "problems": len(problems)})
    else:
        _write(machine, "This machine")
        _write(about_rig, f"Rig {rig}")
        _write_end(len(problems), rig, out)
    if problems:
        raise typer.Exit(EXIT_DATA)


def _write(checks: Sequence[Diagnosis], title: str) -> None:
    if checks:
        heading(title)
        checklist([(check.state, check.about, check.text, check.tries) for check in checks])


def _write_end(problems: int, rig: Path | None, out: Path) -> None:
    if problems:
        say(f"\n{problems} finding{'s prevent' if problems > 1 else ' prevents'} a session.")
    elif rig is None:
        steps(
            "oarlock live scan               what can be heard",
            "oarlock live doctor RIG         what of it arrives",
        )
    else:
        folder = "today" if out == Path() else out
        steps(f"oarlock live run {rig} --out {folder}")
