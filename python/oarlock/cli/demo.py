"""`oarlock demo`: tracks a simulated sculler and a real pendulum and scores both, for new users."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.tables import speed, write_evaluation
from oarlock.cli.terminal import details, heading, number, output_folder, pairs, progress, say, table
from oarlock.cli.track_folder import run_filter, write_folder
from oarlock.cli.verbs import NewFolder, command
from oarlock.rowing.simulation import paper

if TYPE_CHECKING:
    from oarlock import Track
    from oarlock.evaluation import Evaluation

CONDITION = "B-B"
DURATION_S = 40.0
SEED = 0
# the vendor's orientation of the lower unit is wrong after the fastest rotation (docs/mounts.md)
BEFORE_FASTEST_TURN_S = 3.85


@dataclass(frozen=True)
class DemoTrack:
    """A track with its evaluation and the path of its report."""

    track: Track
    evaluation: Evaluation
    report: Path


@dataclass(frozen=True)
class Demo:
    """The tracks of the demonstration; `early`: the pendulum before its reference fails."""

    filtered: DemoTrack
    smoothed: DemoTrack
    pendulum: DemoTrack
    early: Evaluation

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from oarlock.evaluation.summary import summarize

        return {
            "sculler": {
                "condition": CONDITION,
                "steps_per_s": summarize(self.filtered.track).steps_per_s,
                "paper_steps_per_s": paper.STEPS_PER_S,
                "filter": self.filtered.evaluation,
                "smoother": self.smoothed.evaluation,
                "paper": {name: error._asdict() for name, error in paper.table_5(CONDITION).items()},
                "reports": [self.filtered.report, self.smoothed.report],
            },
            "pendulum": {
                "steps_per_s": summarize(self.pendulum.track).steps_per_s,
                "filter": self.pendulum.evaluation,
                "filter_before_fastest_turn": self.early,
                "reports": [self.pendulum.report],
            },
        }


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(app, "oarlock demo", "oarlock demo --out here", "oarlock demo --json", show=_show)(demo)


def demo(*, out: NewFolder = Path("oarlock-demo"), force: bool = False) -> Demo:
    """Track a simulated sculler and a real pendulum, and print the errors of both.

    Args:
        out: folder to write.
        force: replace what is there.
    """
    with output_folder(out, "demo", force) as stage:
        filtered, smoothed = _sculler(stage / "sculler", out / "sculler")
        pendulum, early = _pendulum(stage / "pendulum", out / "pendulum")
    return Demo(filtered, smoothed, pendulum, early)


def _sculler(folder: Path, place: Path) -> tuple[DemoTrack, DemoTrack]:
    """Simulate, track, smooth and score; the results of filter and smoother. `place`: where it will be."""
    import oarlock
    from oarlock.rowing.simulation.experiment import simulate_sculling

    model = oarlock.load_model("sculler")
    with progress("simulating a sculler"):
        truth, recording = simulate_sculling(model, CONDITION, DURATION_S, seed=SEED)
    recording.save(folder / "recording")
    truth.save(folder / "recording" / "truth")
    filtered = run_filter(model, recording, None, None, smooth=False)
    with progress("smoothing") as share:
        smoothed = oarlock.smooth(filtered, progress=share)
    results = []
    for name, track in (("filter", filtered), ("smoother", smoothed)):
        evaluation = oarlock.evaluate(track, truth)
        write_folder(track, folder / name, evaluation=evaluation, truth=truth)
        results.append(DemoTrack(track, evaluation, place / name / "report.html"))
    return results[0], results[1]


def _pendulum(folder: Path, place: Path) -> tuple[DemoTrack, Evaluation]:
    """Calibrate mounts of a real three-link pendulum, track it and score it against the vendor's orientations."""
    import oarlock
    from oarlock.evaluation.orientations import angles_from_orientations
    from oarlock.formats.devices.apdm import read_apdm, read_apdm_orientations
    from oarlock.storage import examples

    file = examples.path("pendulum") / "imuData01.csv"
    recording = read_apdm(file)
    model = oarlock.load_model("pendulum3")
    recording.save(folder / "recording")
    with progress("calibrating mounts"):
        calibration = oarlock.calibration.calibrate_hinge_chain(model, recording)
    calibration.save(folder / "calibration.toml")
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
    return DemoTrack(track, whole, place / "report.html"), early


def _show(result: Demo) -> None:
    from oarlock.evaluation.summary import summarize

    with details():
        heading("1  A sculler, simulated", f"condition {CONDITION} of the paper: surging boat, noise, biases")
        write_evaluation(result.smoothed.evaluation)
        pairs(
            [
                ("the paper's mean RMSE", f"{paper.mean_rmse_deg(CONDITION):.1f} deg, of another rower"),
                ("speed", speed(summarize(result.filtered.track))),
                ("the paper's", f"{paper.STEPS_PER_S:.0f} steps/s"),
            ]
        )
        heading(
            "2  A three-link pendulum, real", f"to {BEFORE_FASTEST_TURN_S:g} s, against the vendor's angles"
        )
        write_evaluation(result.early)
        say()
    scores = (
        ("a simulated sculler", result.filtered.evaluation, "truth"),
        ("  smoothed", result.smoothed.evaluation, "truth"),
        (f"a real pendulum, to {BEFORE_FASTEST_TURN_S:g} s", result.early, "vendor"),
    )
    table(
        ["what", ">mean RMSE deg", ">worst deg", "against"],
        [
            (what, number(score.mean_rmse_deg(), ".3f"), number(score.worst_rmse_deg(), ".3f"), reference)
            for what, score, reference in scores
        ],
        indent=0,
    )
    say(f"\nopen {result.smoothed.report}\nopen {result.pendulum.report}")
