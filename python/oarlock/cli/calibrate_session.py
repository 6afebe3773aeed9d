"""`oarlock calibrate session`: calibrates all sensors from one guided session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from oarlock.cli.body import Mass, Pose, Sensors, Stature, chosen_body
from oarlock.cli.options import Json, ModelName, Settings, assignments, example
from oarlock.cli.terminal import UsageError, free_file, heading, number, print_json, say, steps, table, verb

MARKS = {"pass": "pass", "redo": "DO AGAIN", "kept": "kept"}


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "session",
        short_help="Calibrate everything from one guided session of two minutes.",
        epilog=example(
            "oarlock calibrate session rec --model sculler --out cal.toml",
            "oarlock calibrate session rec --model my.toml --plan plan.toml --out cal.toml",
            "oarlock calibrate session --model sculler --write-plan plan.toml",
            "oarlock calibrate session rec --model lower_body --pose sitting --out cal.toml",
        ),
    )(session)


@verb
def session(
    model: ModelName,
    recording: Annotated[
        Path | None, typer.Argument(metavar="RECORDING", help="A recording folder, or its recording.toml.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Calibration file to write, with a page beside it."),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option("--plan", metavar="FILE", help="Plan of the session; default: the model's own plan."),
    ] = None,
    write_plan: Annotated[
        Path | None, typer.Option("--write-plan", metavar="FILE", help="Write the model's plan and exit.")
    ] = None,
    pose: Pose = "N",
    settings: Settings = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    sensors: Sensors = None,
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="FILE", help="An earlier calibration, such as of clocks."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
    json_output: Json = False,
) -> None:
    """Calibrate biases, magnetometers, mounts and encoders from one guided session.

    Writes the calibration and a page with the results, their uncertainty and the steps to repeat. The exit status
    is 1 if a step must be repeated.
    """
    import oarlock
    from oarlock.report.session_page import write_session_page

    body = chosen_body(model, assignments(settings, "--set"), stature_m, mass_kg, sensors)
    if write_plan is not None:
        free_file(write_plan, force)
        own = oarlock.calibration.default_plan(body, pose)
        own.save(write_plan)
        _say_plan(own, write_plan, json_output)
        return
    if recording is None or out is None:
        raise UsageError("give a RECORDING and --out FILE (or --write-plan FILE to see what to record)")
    page = out.with_suffix(".html")
    for file in (out, page):
        free_file(file, force)
    followed = (
        oarlock.calibration.default_plan(body, pose)
        if plan is None
        else oarlock.calibration.load_session_plan(plan, pose)
    )
    found = oarlock.calibration.calibrate_session(
        body,
        oarlock.load_recording(recording),
        followed,
        calibration=None if calibration is None else oarlock.load_calibration(calibration),
    )
    found.save(out)
    still = next((dict(step.pose) for step in followed.steps if step.kind == "pose"), None)
    write_session_page(found, page, body, still)
    told: Any = found.noted["session"]
    if json_output:
        print_json({"calibration": out, "page": page, "session": told})
    else:
        say(f"Wrote {out} and {page}", style="bold")
        write_session(told)
        steps(f"oarlock track REC --model {model} --calibration {out} --out OUT")
    if not told["passed"]:
        raise typer.Exit(1)


def _say_plan(plan: Any, file: Path, json_output: bool) -> None:
    if json_output:
        print_json({"plan": file, "steps": [s.name for s in plan.steps]})
        return
    say(f"Wrote {file}", style="bold")
    heading(plan.name)
    for k, step in enumerate(plan.steps, 1):
        say(f"{k}. {step.name}: {step.say}", indent=2)


def write_session(told: Mapping[str, Any]) -> None:
    """Prints one line for each check, then the steps to repeat."""
    checks: Sequence[Mapping[str, Any]] = told["check"]
    heading("Steps", f"plan: {told['plan']}")
    table(
        ["step", ">from s", ">to s", "", "in words"],
        [
            (
                s["name"],
                number(s.get("start_s"), ".1f"),
                number(s.get("end_s"), ".1f"),
                MARKS[s["outcome"]],
                s["sentence"],
            )
            for s in told["step"]
        ],
    )
    for subject in dict.fromkeys(c["subject"] for c in checks if c["subject"]):
        heading(subject)
        table(
            ["what", "found", ">std", ">limit", "unit", ""],
            [_row(c) for c in checks if c["subject"] == subject],
        )
    room = [c for c in checks if c["what"] == "magnetic field" and not c["subject"]]
    if room:
        heading("Magnetic field", f"{room[0]['found']}. {room[0]['sentence']}")
    for outcome, title in (("kept", "Kept as before"), ("redo", "Do again")):
        own = [c for c in checks if c["outcome"] == outcome]
        if own:
            heading(title)
            for c in own:
                about = f"{c['step']}, {c['subject']}" if c["subject"] else c["step"]
                say(f"{about}: {c['sentence']}", indent=2)
    if told["passed"]:
        say()
        say("Passed.", style="bold green")


def _row(check: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        check["step"] if check["what"] == "movement" else check["what"],
        check["found"],
        number(check.get("std"), ".2g"),
        number(check.get("limit"), ".2g"),
        check["unit"],
        MARKS[check["outcome"]],
    )
