"""`oarlock calibrate session`: calibrates all sensors from one guided session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from oarlock.cli.show import show_document
from oarlock.cli.terminal import UsageError, free_file, heading, number, say, steps, table
from oarlock.cli.verbs import Incomplete, NewFile, command

if TYPE_CHECKING:
    from oarlock import Calibration
    from oarlock.cli.body import Body

MARKS = {"pass": "pass", "redo": "DO AGAIN", "kept": "kept"}


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    command(
        group,
        "oarlock calibrate session rec --model sculler --out cal.toml",
        "oarlock calibrate session rec --model my.toml --plan plan.toml --out cal.toml",
        "oarlock calibrate session --model sculler --write-plan plan.toml",
        "oarlock calibrate session rec --model lower_body --pose sitting --out cal.toml",
        show=_show,
        metavars={"recording": "RECORDING"},
    )(session)


def session(
    recording: Path | None = None,
    *,
    model: Body,
    out: NewFile | None = None,
    plan: Path | None = None,
    write_plan: NewFile | None = None,
    pose: Literal["N", "T", "sitting"] = "N",
    calibration: Calibration | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Calibrate biases, magnetometers, mounts and encoders from one guided session of two minutes.

    Writes the calibration and a page with the results, their uncertainty and the steps to repeat. The exit status
    is 1 if a step must be repeated.

    Args:
        recording: a recording folder, or its recording.toml.
        model: the body.
        out: calibration file to write, with a page beside it.
        plan: plan of the session; default: the model's own plan.
        write_plan: write the model's plan and exit.
        pose: still pose of the session: N (arms hanging), T (arms level) or sitting.
        calibration: an earlier calibration, such as of clocks.
        force: replace files that exist.
    """
    import oarlock
    from oarlock.report.session_page import write_session_page

    body = model.model
    if write_plan is not None:
        own = oarlock.calibration.default_plan(body, pose)
        own.save(write_plan)
        return {"plan": own.name, "steps": [f"{s.name}: {s.say}" for s in own.steps], "written": write_plan}
    if recording is None or out is None:
        raise UsageError("give a RECORDING and --out FILE (or --write-plan FILE to see what to record)")
    page = out.with_suffix(".html")
    free_file(page, force)
    followed = (
        oarlock.calibration.default_plan(body, pose)
        if plan is None
        else oarlock.calibration.load_session_plan(plan, pose)
    )
    result = oarlock.calibration.calibrate_session(
        body, oarlock.load_recording(recording), followed, calibration=calibration
    )
    result.save(out)
    still = next((dict(step.pose) for step in followed.steps if step.kind == "pose"), None)
    write_session_page(result, page, body, still)
    checks: Any = result.noted["session"]
    document = {
        "calibration": out,
        "page": page,
        "session": checks,
        "next": [f"oarlock track REC {model.words} --calibration {out} --out OUT"],
    }
    if not checks["passed"]:
        raise Incomplete(document)
    return document


def _show(result: dict[str, Any]) -> None:
    if "session" not in result:
        show_document(result)
        return
    say(f"Wrote {result['calibration']} and {result['page']}", style="bold")
    write_session(result["session"])
    steps(*result["next"])


def write_session(session: Mapping[str, Any]) -> None:
    """Prints one line for each check, then the steps to repeat."""
    checks: Sequence[Mapping[str, Any]] = session["check"]
    heading("Steps", f"plan: {session['plan']}")
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
            for s in session["step"]
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
    if session["passed"]:
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
