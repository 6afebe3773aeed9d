"""`oarlock run`: `oarlock.run` as a verb, which asks a person at the terminal for what is not clear."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.function_verbs import FunctionText, arguments_of, made_verb, options_of
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import UsageError, check_folder, details, free_file, print_json, say, steps

if TYPE_CHECKING:
    from oarlock.tracking.settings import Settings

RUN = FunctionText.of("oarlock.pipeline:run")
Athlete = Annotated[str | None, typer.Option(metavar="NAME", help="Who was recorded; a pseudonym is enough.")]
Rate = Annotated[float | None, typer.Option(metavar="HZ", help="Rate of the rows, 0: one for every sample.")]


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    options = options_of(RUN, "recording", without=("progress", "settings"))
    options += [("athlete", Athlete, None), ("output_rate_hz", Rate, None), ("json_output", Json, False)]
    app.command(
        "run",
        help=RUN.doc.partition("\n\nArgs:")[0] + "\n\nThe same in Python: oarlock.run.",
        epilog=example(
            "oarlock run measurements.zip --model lower_body --stature-m 1.78 --mass-kg 74 --out walk",
            "oarlock run arm.csv --model arm --sensors thorax,upper_arm_r,forearm_r --out reach",
            "oarlock run trial --model full_body --session session --stature-m 1.71 --out trial-out",
            "oarlock run trial.csv --model arm --units thorax=00B421E6,forearm_r=00B421ED --out trial-out",
            "oarlock run trial --model my.toml --calibration cal.toml --out trial-out",
        ),
    )(made_verb(run, options))


def run(
    recording: Path,
    out: Path,
    model: str,
    athlete: str | None,
    output_rate_hz: float | None,
    json_output: bool,
    **typed: Any,
) -> None:
    """Reads the recordings, calls `oarlock.run`, and prints the result."""
    import oarlock
    from oarlock.cli.import_path import asked_recording
    from oarlock.cli.result import result_of, write_result
    from oarlock.cli.tables import write_summary

    if typed["session"] is not None and typed["calibration"] is not None:
        raise UsageError("--session and --calibration contradict each other")
    if typed["session"] is None and typed["pose"] != "N":
        raise UsageError(
            f"--pose {typed['pose']} is the still pose of a guided session: give it with --session"
        )
    for place in (out / "recording", out / "track"):
        check_folder(place, typed["force"])
    if typed["calibration"] is None:
        free_file(out / "calibration.toml", typed["force"])
    arguments = arguments_of(RUN, typed)
    units, pick, together = (arguments.pop(name, None) for name in ("units", "pick", "together"))
    read = asked_recording(recording, pick, bool(together), model, units, athlete, json_output)
    if "session" in arguments:
        arguments["session"] = asked_recording(
            arguments["session"], None, False, model, units, None, json_output
        )
    settings: Settings = {} if output_rate_hz is None else {"output_rate_hz": output_rate_hz}
    track = oarlock.run(read, out, model=model, progress=True, **arguments, **settings)
    report = out / "track/report.html"
    page = report if report.exists() else None
    if json_output:
        print_json({"out": out, "report": page, **result_of(track), "notes": track.notes})
        return
    with details():
        write_summary(track)
        say()
    write_result(track, page, suspects=True)
    with details():
        steps(f"oarlock view {out}/track", f"oarlock export {out}/track --out FOLDER")
