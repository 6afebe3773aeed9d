"""`oarlock import`: other formats into a recording folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Force, Json, OutFolder, example
from oarlock.cli.terminal import new_folder, number, print_json, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Recording

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Turn other formats into a recording.")


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="import")


@group.command("apdm", epilog=example("oarlock import apdm imuData01.csv --out rec"))
@verb
def apdm(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="CSV export of an APDM (Opal) recording.")],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import an APDM export: gyroscope, accelerometer, magnetometer of every sensor."""
    from oarlock.io.apdm import read_apdm

    _write(read_apdm(file), file, out, force, json_output)


@group.command("csv", epilog=example("oarlock import csv mapping.toml --out rec"))
@verb
def csv(
    mapping: Annotated[
        Path,
        typer.Argument(metavar="MAPPING", help="TOML file that names files, columns, units and sensors."),
    ],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import CSV files by a mapping file: decimal commas, clock times and epoch milliseconds are read."""
    from oarlock.io.csv import read_csv

    _write(read_csv(mapping), mapping, out, force, json_output)


def _write(recording: Recording, source: Path, out: Path, force: bool, json_output: bool) -> None:
    new_folder(out, force)
    recording.save(out)
    if json_output:
        print_json(
            {
                "recording": out,
                "source": source,
                "start_s": recording.start_s,
                "end_s": recording.end_s,
                "streams": [
                    {"name": s.name, "kind": s.kind, "samples": len(s), "rate_hz": s.rate_hz}
                    for s in recording.streams
                ],
            }
        )
        return
    say(f"Wrote {out} from {source}", style="bold")
    table(
        ["stream", "kind", ">samples", ">rate Hz", ">missing"],
        [
            (s.name, s.kind, len(s), number(s.rate_hz, ".1f"), number(s.missing_share, ".1%"))
            for s in recording.streams
        ],
    )
    steps(f"oarlock track {out} --model MODEL --out {out}-track")
