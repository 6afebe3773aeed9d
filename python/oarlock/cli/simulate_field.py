"""`oarlock simulate --field`: simulates a recording on the water, with errors that the model does not contain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import assignments
from oarlock.cli.terminal import (
    UsageError,
    heading,
    output_folder,
    pairs,
    print_json,
    progress,
    say,
    steps,
    table,
)

if TYPE_CHECKING:
    from oarlock import Model
    from oarlock.rowing import FieldEffects, FieldTrial

Field = Annotated[
    str | None,
    typer.Option(
        "--field",
        metavar="careful|wild|misfit|off",
        help="Preset of field errors: careful session, large errors, wrong mounts and lengths, or only --effect.",
    ),
]
Effect = Annotated[
    list[str] | None,
    typer.Option(
        "--effect", metavar="NAME=VALUE", help="Strength of one effect, SI units. Repeatable; needs --field."
    ),
]
Strength = Annotated[
    float,
    typer.Option("--strength", metavar="X", help="Factor on all effects of --field: 0 none, 1 unchanged."),
]
RateHz = Annotated[float, typer.Option("--rate-hz", metavar="HZ", help="Rate of all sensors; needs --field.")]
Course = tuple[str, float, float | tuple[float, ...], float, int]
"""Condition, length in s, strokes per minute, samples per second, seed."""


def asked_effects(
    field: str | None, effect: list[str] | None, strength: float, rate_hz: float
) -> FieldEffects | None:
    """Return the effects that the options select; None without `--field`.

    Raises:
        UsageError: an unknown preset or effect, or options that need `--field`.
        DataError: a strength out of range.
    """
    from oarlock.rowing.simulation.simulators import PRESETS

    if field is None:
        if effect or strength != 1.0 or rate_hz != 125.0:
            raise UsageError("--effect, --strength and --rate-hz need --field, for example --field careful")
        return None
    if field not in PRESETS:
        raise UsageError(f"--field {field}: choose one of {', '.join(PRESETS)}")
    told = assignments(effect, "--effect")
    unknown = [name for name in told if name not in PRESETS["off"].strengths()]
    if unknown:
        known = ", ".join(PRESETS["off"].strengths())
        raise UsageError(f"--effect {unknown[0]}: no such effect. There are {known}")
    return replace(PRESETS[field].scaled(strength), **told)


def simulate_in_the_field(
    model: Model, effects: FieldEffects, out: Path, course: Course, named: str, force: bool, json_output: bool
) -> None:
    """Writes the recording, ground truth, markers and true calibration, and prints the files."""
    from oarlock.rowing import simulate_field

    condition, duration_s, rate_spm, rate_hz, seed = course
    with output_folder(out, "recording", force) as stage, progress("simulating"):
        trial = simulate_field(
            model,
            effects,
            condition=condition,
            duration_s=duration_s,
            rate_spm=rate_spm,
            rate_hz=rate_hz,
            seed=seed,
        )
        trial.save(stage)
    written = {
        "recording": out,
        "truth": out / "truth",
        "markers": out / "markers.csv",
        "true_calibration": out / "true_calibration.toml",
    }
    if json_output:
        told = {"streams": trial.recording.names, "seed": seed, "effects": effects.strengths()}
        print_json(written | told)
        return
    _tell(trial, written, out, named)


def _tell(trial: FieldTrial, written: dict[str, Path], out: Path, named: str) -> None:
    from oarlock.rowing.field.effects import GROUPS, FieldEffects

    say(f"Wrote {out}", style="bold")
    recording = trial.recording
    span = f"{out}  ({recording.start_s:.1f} to {recording.end_s:.1f} s)"
    pairs(
        [
            ("recording", span),
            ("streams", ", ".join(recording.names)),
            ("truth", written["truth"]),
            ("markers", f"{written['markers']}  (true centres of shoulders, elbows and wrists)"),
            ("true calibration", written["true_calibration"]),
        ]
    )
    heading("Effects that are on", "m, rad, s and uT; without unit: share")
    off, strengths = FieldEffects.off().strengths(), trial.effects.strengths()
    on = {
        group: [f"{name} {strengths[name]:.4g}" for name in names if strengths[name] != off[name]]
        for group, names in GROUPS.items()
    }
    table(
        ["effect", "strength"],
        [(group.replace("_", " "), ", ".join(told)) for group, told in on.items() if told],
    )
    steps(
        f"oarlock track {out} --model {named} --out {out}-track",
        f"oarlock evaluate {out}-track {out}/truth",
    )
