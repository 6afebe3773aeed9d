"""`oarlock calibrate clocks`: finds the offset and drift of each stream's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.calibrate_tree import OutFile, RecordingFolder, Start, track_next
from oarlock.cli.options import Json, ModelName, Replace, Settings, assignments, example, names
from oarlock.cli.terminal import free_file, heading, number, print_json, progress, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "clocks",
        epilog=example(
            "oarlock calibrate clocks rec --model sculler --out cal.toml",
            "oarlock calibrate clocks rec --model my.toml --reference encoder --out cal.toml",
        ),
    )(clocks)


@verb
def clocks(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    calibration: Start = None,
    reference: Annotated[
        str | None,
        typer.Option(
            "--reference",
            metavar="NAMES",
            help="Streams of the reference clock, comma-separated; default: found from the time stamps.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", metavar="N", min=1, help="Tracks in parallel; default: all cores."),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Find the offset and drift of each stream's clock from movement that all sensors measure."""
    import oarlock

    body = oarlock.load_model(model, parameters=assignments(settings, "--set"))
    free_file(out, force)
    known = None if calibration is None else oarlock.load_calibration(calibration)
    with progress("calibrating clocks") as told:
        found = oarlock.calibration.calibrate_clocks(
            body,
            oarlock.load_recording(recording),
            known,
            reference=None if reference is None else names(reference),
            threads=jobs,
            progress=told,
        )
    found.save(out)
    if json_output:
        told_clocks = {name: vars(clock) for name, clock in found.clocks.items()}
        print_json({"calibration": out, "clocks": told_clocks, "noted": found.noted["clocks"]})
        return
    say(f"Wrote {out}", style="bold")
    write_clocks(found)
    steps(track_next(recording, model, out))


def write_clocks(calibration: Calibration) -> None:
    """Prints each clock with its standard deviations, and the clocks that were not determined."""
    noted: dict[str, Any] = dict(calibration.noted)["clocks"]  # type: ignore[assignment]
    heading("Clocks", f"against {', '.join(noted['reference'])}; positive: late, fast")
    table(
        ["stream", ">offset ms", ">std ms", ">drift ppm", ">std ppm"],
        [
            (
                name,
                number(1e3 * clock.offset_s, "+.2f"),
                number(1e3 * clock.offset_std_s, ".2f"),
                number(1e6 * clock.drift, "+.1f"),
                number(1e6 * clock.drift_std, ".1f"),
            )
            for name, clock in calibration.clocks.items()
        ],
    )
    for name, why in noted["refused"].items():
        say(f"{name}: {why}", style="dim", indent=2)
