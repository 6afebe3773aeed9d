"""`oarlock run`: from the files of a recording to angles and a report: import, calibrate, track, report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.body import Mass, Pose, Sensors, Stature
from oarlock.cli.options import Force, Json, ModelName, example, names
from oarlock.cli.terminal import UsageError, check_folder, details, free_file, print_json, steps, verb
from oarlock.cli.unit_options import UnitsOption, assignment

if TYPE_CHECKING:
    from oarlock.tracking.settings import Settings


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "run",
        epilog=example(
            "oarlock run measurements.zip --model lower_body --stature-m 1.78 --mass-kg 74 --out walk",
            "oarlock run arm.csv --model arm --sensors thorax,upper_arm_r,forearm_r --out reach",
            "oarlock run trial --model full_body --session session --stature-m 1.71 --out trial-out",
            "oarlock run trial.csv --model arm --units thorax=00B421E6,forearm_r=00B421ED --out trial-out",
            "oarlock run trial --model my.toml --calibration cal.toml --out trial-out",
        ),
    )(run)


@verb
def run(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", help="File, folder or zip file of a recording, of any format of import."
        ),
    ],
    model: ModelName,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FOLDER", help="Folder to write: recording, calibration, track."),
    ],
    units: UnitsOption = None,
    sensors: Sensors = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    pick: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which recording, if the place has several.")
    ] = None,
    together: Annotated[
        bool, typer.Option("--together", help="All files are units of one recording; names name the units.")
    ] = False,
    session: Annotated[
        Path | None,
        typer.Option("--session", metavar="PATH", help="A recording of the guided calibration session."),
    ] = None,
    pose: Pose = "N",
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="FILE", help="A calibration; nothing is calibrated then."),
    ] = None,
    athlete: Annotated[
        str | None, typer.Option(metavar="NAME", help="Who was recorded; a pseudonym is enough.")
    ] = None,
    low_pass_hz: Annotated[
        float,
        typer.Option(
            "--low-pass-hz", metavar="HZ", help="Cut-off of the readings of inertial units; 0: none."
        ),
    ] = 0.0,
    output_rate_hz: Annotated[
        float | None, typer.Option(metavar="HZ", help="Rate of the rows, 0: one for every sample.")
    ] = None,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Import, calibrate with what is there, track, smooth and report: one command from files to angles.

    Mounts come from --calibration, or from the guided session, or from the recording itself: it begins with two
    seconds of standing still in the rest posture, and most movement is forward and backward. Two hinges whose axes this
    does not determine are tracked as one ball. The same in Python: oarlock.run.
    """
    import oarlock
    from oarlock.cli.import_path import asked_recording
    from oarlock.cli.result import result_of, write_result
    from oarlock.cli.tables import write_summary

    if session is not None and calibration is not None:
        raise UsageError("--session and --calibration contradict each other")
    if session is None and pose != "N":
        raise UsageError(f"--pose {pose} is the still pose of a guided session: give it with --session")
    for place in (out / "recording", out / "track"):
        check_folder(place, force)
    if calibration is None:
        free_file(out / "calibration.toml", force)
    settings: Settings = {} if output_rate_hz is None else {"output_rate_hz": output_rate_hz}
    place_of = assignment(units)
    track = oarlock.run(
        asked_recording(path, pick, together, model, place_of, athlete, json_output),
        out,
        model=model,
        sensors=None if sensors is None else names(sensors),
        stature_m=stature_m,
        mass_kg=mass_kg,
        session=None
        if session is None
        else asked_recording(session, None, together, model, place_of, None, json_output),
        pose=pose,
        calibration=calibration,
        low_pass_hz=low_pass_hz or None,
        force=force,
        progress=True,
        **settings,
    )
    report = out / "track/report.html"
    if json_output:
        print_json(
            {
                "out": out,
                "report": report if report.exists() else None,
                **result_of(track),
                "notes": track.notes,
            }
        )
        return
    with details():
        write_summary(track)
    write_result(track, report if report.exists() else None)
    with details():
        steps(f"oarlock view {out}/track", f"oarlock export {out}/track --out FOLDER")
