"""`oarlock simulate --calibration-session`: simulates a guided calibration session with its ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.cli.terminal import output_folder, pairs, print_json, progress, say, steps

if TYPE_CHECKING:
    from oarlock import Model


def simulate_guided_session(
    model: Model, out: Path, named: str, pose: str, seed: int, force: bool, json_output: bool
) -> None:
    """Writes a recording of a person who follows the model's plan, and the ground truth."""
    from oarlock.calibration import default_plan
    from oarlock.simulation import simulate_session

    with output_folder(out, "recording", force) as stage, progress("simulating"):
        trial = simulate_session(model, default_plan(model, pose), seed=seed)
        trial.save(stage)
    if json_output:
        names = trial.recording.names
        print_json({"recording": out, "truth": out / "truth", "streams": names, "seed": seed})
        return
    say(f"Wrote {out}", style="bold")
    pairs(
        [
            ("recording", f"{out}  ({trial.recording.start_s:.1f} to {trial.recording.end_s:.1f} s)"),
            ("streams", ", ".join(trial.recording.names)),
            ("plan", out / "plan.toml"),
            ("true mounts and biases", out / "true_calibration.toml"),
        ]
    )
    taken = "" if pose == "N" else f" --pose {pose}"
    steps(f"oarlock calibrate session {out} --model {named}{taken} --out {out}-cal.toml")
