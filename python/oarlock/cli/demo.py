"""`oarlock demo`: tracks a simulated sculler and a real pendulum and scores both, for new users."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from oarlock.cli.calibrate_text import write_chain
from oarlock.cli.options import Force, Json, example
from oarlock.cli.tables import error, speed, write_notes, write_sensors
from oarlock.cli.terminal import (
    details,
    heading,
    number,
    output_folder,
    pairs,
    print_json,
    progress,
    say,
    table,
    verb,
)
from oarlock.cli.track_folder import run_filter, write_folder
from oarlock.rowing.simulation import paper

if TYPE_CHECKING:
    from oarlock import Calibration, Evaluation, Track

CONDITION = "B-B"
DURATION_S = 40.0
SEED = 0
# the vendor's orientation of the lower unit is wrong after the fastest rotation
BEFORE_FASTEST_TURN_S = 3.85


class DemoResult(NamedTuple):
    """A track with its evaluation and the path of its report."""

    track: Track
    evaluation: Evaluation
    report: Path


class Pendulum(NamedTuple):
    """Result of the pendulum: evaluation before the reference fails, and the calibrated mounts."""

    scored: DemoResult
    early: Evaluation
    calibration: Calibration


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "demo",
        epilog=example("oarlock demo", "oarlock demo --out here", "oarlock demo --json"),
    )(demo)


@verb
def demo(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER", help="Folder to write.")] = Path(
        "oarlock-demo"
    ),
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Track a simulated sculler and a real pendulum, and print the errors of both."""
    with output_folder(out, "demo", force) as stage:
        filtered, smoothed = _sculler(stage / "sculler", out / "sculler")
        if not json_output:
            with details():
                _write_sculler(filtered, smoothed)
        pendulum = _pendulum(stage / "pendulum", out / "pendulum")
    if json_output:
        print_json(_document(filtered, smoothed, pendulum))
        return
    with details():
        _write_pendulum(pendulum)
    _write_end(filtered, smoothed, pendulum)


# --- sculler ------------------------------------------------------------------------------------------


def _sculler(folder: Path, place: Path) -> tuple[DemoResult, DemoResult]:
    """Simulate, track, smooth and score; return the results of filter and smoother. `place`: where it will be."""
    import oarlock
    from oarlock.rowing.simulation.experiment import simulate_sculling

    model = oarlock.load_model("sculler")
    with progress("simulating a sculler"):
        truth, recording = simulate_sculling(model, CONDITION, DURATION_S, seed=SEED)
    recording.save(folder / "recording")
    truth.save(folder / "recording" / "truth")
    filtered = run_filter(model, recording, None, None, smooth=False)
    with progress("smoothing") as told:
        smoothed = oarlock.smooth(filtered, progress=told)
    results = []
    for name, track in (("filter", filtered), ("smoother", smoothed)):
        evaluation = oarlock.evaluate(track, truth)
        write_folder(track, folder / name, evaluation=evaluation, truth=truth)
        results.append(DemoResult(track, evaluation, place / name / "report.html"))
    return results[0], results[1]


def _write_sculler(filtered: DemoResult, smoothed: DemoResult) -> None:
    from oarlock.evaluation.summary import summarize

    summary = summarize(filtered.track)
    heading("1  A sculler, simulated")
    say(
        "5 inertial units, a seat encoder and 4 oar encoders on a surging boat, with the noise and biases\n"
        f"of the paper's condition {CONDITION}. The ground truth is known, so errors are exact."
    )
    heading("Error of each joint", f"from {filtered.evaluation.start_s:g} s on, with the paper's values")
    printed = paper.table_5(CONDITION)
    table(
        ["joint", ">filter", ">smoothed", "unit", ">r", ">in 95 % band %", ">NEES", ">paper", ">paper r"],
        [
            _sculler_row(row, smooth_row, printed.get(row["joint"]))
            for joint, row, smooth_row in zip(
                filtered.evaluation.joints, filtered.evaluation.rows, smoothed.evaluation.rows, strict=True
            )
            if joint.observed
        ],
    )
    for line in (
        f"paper: {paper.CITATION};",
        "The paper has another rower and motion and no oar encoders: compare the order of magnitude only.",
    ):
        say(f"  {line}", style="dim")
    write_sensors(filtered.evaluation.sensors)
    write_notes(summary.notes)
    say()
    pairs(
        [
            ("mean RMSE", f"{_mean(filtered)} deg filtered, {_mean(smoothed)} deg smoothed (11 angles)"),
            ("  the paper's", f"{paper.mean_rmse_deg(CONDITION):.1f} deg (the 9 angles that are not 0)"),
            ("speed", speed(summary)),
            ("  the paper's", f"{paper.STEPS_PER_S:.0f} steps/s"),
            ("report", smoothed.report),
        ]
    )


def _sculler_row(
    row: dict[str, Any], smooth: dict[str, Any], printed: paper.PrintedError | None
) -> tuple[str, ...]:
    return (
        row["joint"],
        error(row["rmse"], row["unit"]),
        error(smooth["rmse"], smooth["unit"]),
        row["unit"],
        number(row["correlation"], ".4f"),
        number(row["coverage_percent"], ".1f"),
        number(row["nees"], ".2f"),
        "" if printed is None else f"{printed.rmse:.2f}",
        "" if printed is None else number(printed.correlation, ".3f"),
    )


def _mean(scored: DemoResult) -> str:
    joints = [name for name in paper.table_5(CONDITION) if name != "seat"]
    return number(scored.evaluation.mean_rmse_deg(joints), ".3f")


# --- pendulum -----------------------------------------------------------------------------------------


def _pendulum(folder: Path, place: Path) -> Pendulum:
    """Calibrate mounts of a real three-link pendulum, track it and score it against the vendor's orientations.

    `place` is where the folder will be.
    """
    import oarlock
    from oarlock.evaluation.orientations import angles_from_orientations
    from oarlock.formats.devices.apdm import read_apdm, read_apdm_orientations
    from oarlock.storage import examples

    file = examples.path("pendulum") / "imuData01.csv"
    recording = read_apdm(file)
    model = oarlock.load_model("pendulum3")
    recording.save(folder / "recording")
    with progress("calibrating mounts"):
        found = oarlock.calibration.calibrate_hinge_chain(model, recording)
    found.save(folder / "calibration.toml")
    calibration = oarlock.load_calibration(folder / "calibration.toml")
    track = run_filter(model, recording.only(calibration.mounts), calibration, None, smooth=False)
    orientations = read_apdm_orientations(file)
    whole, early = (
        oarlock.evaluation.evaluate_orientations(
            track, recording, orientations, calibration, end_s=end_s, reference="the vendor's orientations"
        )
        for end_s in (None, BEFORE_FASTEST_TURN_S)
    )
    vendor = angles_from_orientations(model, recording, orientations, calibration)
    # The verdict of the report is about the time in which the reference is right.
    write_folder(track, folder, evaluation=early, truth=vendor.track)
    return Pendulum(DemoResult(track, whole, place / "report.html"), early, calibration)


def _write_pendulum(result: Pendulum) -> None:
    from oarlock.evaluation.summary import summarize

    track, evaluation, report = result.scored
    summary = summarize(track)
    say()
    heading("2  A three-link pendulum, real")
    say(
        "3 inertial units: raw gyroscope, accelerometer, magnetometer. Their mounts are not documented:\n"
        "they are calibrated from a stationary interval and the plane of the swing."
    )
    write_chain(result.calibration)
    heading("Angle of each hinge", "against the vendor's orientations, which have errors of their own")
    table(
        ["hinge", ">RMSE", ">bias", "unit", ">r", f">RMSE to {BEFORE_FASTEST_TURN_S:g} s", "note"],
        [
            (
                row["joint"],
                error(row["rmse"], row["unit"]),
                error(row["bias"], row["unit"], sign="+"),
                row["unit"],
                number(row["correlation"], ".4f"),
                error(early["rmse"], early["unit"]),
                row["note"],
            )
            for row, early in zip(evaluation.rows, result.early.rows, strict=True)
        ],
    )
    say(
        "off the hinge: part of the vendor's rotation between neighbours that is not about the hinge,\n"
        "relative to rest; plain: as in the file, with a separate north for each unit. In the fastest\n"
        "rotation (3.87 s, 500 deg/s) the vendor's orientation of the lower unit jumps by 5 to 6 deg, as\n"
        "magnetometer and accelerometer both show (docs/mounts.md); so errors are scored to 3.85 s.",
        style="dim",
        indent=2,
    )
    write_sensors(evaluation.sensors)
    write_notes(summary.notes)
    say()
    pairs([("speed", speed(summary)), ("report", report)])


# --- both ---------------------------------------------------------------------------------------------


def _write_end(filtered: DemoResult, smoothed: DemoResult, pendulum: Pendulum) -> None:
    table(
        ["what", ">mean RMSE deg", ">worst deg", "against"],
        [
            ("a simulated sculler", *_two(filtered), "truth"),
            ("  smoothed", *_two(smoothed), "truth"),
            (
                f"a real pendulum, to {BEFORE_FASTEST_TURN_S:g} s",
                *_two(pendulum.scored, pendulum.early),
                "vendor",
            ),
        ],
        indent=0,
    )
    say(f"\nopen {smoothed.report}\nopen {pendulum.scored.report}")


def _two(scored: DemoResult, scores: Evaluation | None = None) -> tuple[str, str]:
    scores = scores or scored.evaluation
    return number(scores.mean_rmse_deg(), ".3f"), number(scores.worst_rmse_deg(), ".3f")


def _document(filtered: DemoResult, smoothed: DemoResult, pendulum: Pendulum) -> dict[str, object]:
    from oarlock.evaluation.summary import summarize

    return {
        "sculler": {
            "condition": CONDITION,
            "steps_per_s": summarize(filtered.track).steps_per_s,
            "paper_steps_per_s": paper.STEPS_PER_S,
            "filter": filtered.evaluation.to_dict(),
            "smoother": smoothed.evaluation.to_dict(),
            "paper": {name: printed._asdict() for name, printed in paper.table_5(CONDITION).items()},
            "reports": [filtered.report, smoothed.report],
        },
        "pendulum": {
            "steps_per_s": summarize(pendulum.scored.track).steps_per_s,
            "filter": pendulum.scored.evaluation.to_dict(),
            "filter_before_fastest_turn": pendulum.early.to_dict(),
            "reports": [pendulum.scored.report],
        },
    }
