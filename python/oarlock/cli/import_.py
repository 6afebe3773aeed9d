"""`oarlock import`: converts other formats to a recording folder, one verb per format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Force, Json, OutFolder, example
from oarlock.cli.terminal import new_folder, number, print_json, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Recording

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Convert other formats to a recording.")


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
    from oarlock.formats.apdm import read_apdm

    _write(read_apdm(file), file, out, force, json_output)


@group.command("csv", epilog=example("oarlock import csv mapping.toml --out rec"))
@verb
def csv(
    mapping: Annotated[
        Path,
        typer.Argument(
            metavar="MAPPING", help="TOML file with the names of files, columns, units and sensors."
        ),
    ],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import CSV files described by a mapping file; decimal commas, clock times and epoch milliseconds are read."""
    from oarlock.formats.csv import read_csv

    _write(read_csv(mapping), mapping, out, force, json_output)


@group.command("dfjimu", epilog=example("oarlock import dfjimu data_3D_01.mat --out rec"))
@verb
def dfjimu(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of dfjimu, .mat.")],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import a dfjimu recording: two inertial units on two bodies connected by a ball joint."""
    from oarlock.formats.dfjimu import read_dfjimu

    _write(read_dfjimu(file), file, out, force, json_output)


@group.command("diodem", epilog=example("oarlock import diodem trial1 --mounted foam --out rec"))
@verb
def diodem(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="A trial: the folder with imu_rigid.csv.")],
    out: OutFolder,
    mounted: Annotated[str, typer.Option(help="Which inertial units: rigid (screwed on) or foam.")] = "rigid",
    mag_unit_ut: Annotated[
        float | None,
        typer.Option(help="Scale of the magnetometers, uT per unit; without it they are not imported."),
    ] = None,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import a DIODEM trial: five inertial units on a chain of five links."""
    from oarlock.formats.diodem import read_diodem

    recording = read_diodem(folder, mounted, mag_unit_ut)  # type: ignore[arg-type]
    _write(recording, folder, out, force, json_output)


@group.command("openaxes", epilog=example("oarlock import openaxes openaxes_ur5 --run circle-100 --out rec"))
@verb
def openaxes(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="The data folder that contains synced_imu.")
    ],
    run: Annotated[str, typer.Option(help="Name of the run, such as circle-100.")],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import an OpenAXES run: two inertial units on the links of a robot."""
    from oarlock.formats.openaxes import read_openaxes

    _write(read_openaxes(folder, run), folder, out, force, json_output)


@group.command("broad", epilog=example("oarlock import broad 01_undisturbed_slow_rotation_A.mat --out rec"))
@verb
def broad(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A trial of the BROAD data set, .mat.")],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import a BROAD trial: one inertial unit with magnetometer."""
    from oarlock.formats.broad import read_broad

    _write(read_broad(file), file, out, force, json_output)


@group.command("qmt", epilog=example("oarlock import qmt full_body_example_data.mat --out rec"))
@verb
def qmt(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The full-body example of qmt, .mat.")],
    out: OutFolder,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import the full-body example of qmt: an inertial unit on each of sixteen segments."""
    from oarlock.formats.qmt import read_qmt

    _write(read_qmt(file), file, out, force, json_output)


def _write(recording: Recording, source: Path, out: Path, force: bool, json_output: bool) -> None:
    from oarlock.recording.packets import lost_packets, missing_packets

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
                    {
                        "name": s.name,
                        "kind": s.kind,
                        "samples": len(s),
                        "rate_hz": s.rate_hz,
                        "missing_packets": missing_packets(recording, s),
                    }
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
    for stream in recording.streams:
        if (lost := lost_packets(recording, stream)) is not None and lost.text():
            say(f"{stream.name}: {lost.text()}", indent=2)
    steps(f"oarlock track {out} --model MODEL --out {out}-track")
