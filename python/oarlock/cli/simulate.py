"""`oarlock simulate`: simulates a rower's recording with its ground truth."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.body import Mass, Pose, Sensors, Stature, chosen_body
from oarlock.cli.options import Force, Json, ModelName, OutFolder, Settings, assignments, example
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
    verb,
)

if TYPE_CHECKING:
    from oarlock import Model
    from oarlock.rowing import FieldEffects, FieldTrial, HullRotation


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


class BoatMotion(StrEnum):
    """Motion of the boat."""

    still = "still"
    surge = "surge"
    pitch = "pitch"
    rotating = "rotating"


def _amplitude(flag: str, what: str, default: str) -> Any:
    return typer.Option(
        flag, metavar="RAD", help=f"{what} of a rotating hull, amplitude, rad. Default {default}."
    )


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "simulate",
        epilog=example(
            "oarlock simulate --out trial",
            "oarlock simulate --out trial --duration-s 600 --rate-spm 20,34 --condition S-NB",
            "oarlock simulate --model my.toml --set l_ua_r=0.31 --seed 7 --out trial",
            "oarlock simulate --out trial --field careful --rate-spm 20,34",
            "oarlock simulate --out trial --field off --effect mount_error_rad=0.09 --effect packet_loss=0.05",
            "oarlock simulate --model sculler_boat --hull rotating --hull-roll-rad 0.05 --out rough",
            "oarlock simulate --model sweep --out pair",
            "oarlock simulate --calibration-session --out session",
            "oarlock simulate --calibration-session --model arm7 --seed 3 --out session",
            "oarlock simulate --calibration-session --model lower_body --stature-m 1.78 --mass-kg 74 --out session",
        ),
    )(simulate)


@verb
def simulate(
    out: OutFolder,
    model: ModelName = "sculler",
    duration_s: Annotated[float, typer.Option("--duration-s", metavar="S", help="Length, s.")] = 40.0,
    rate_spm: Annotated[
        str, typer.Option("--rate-spm", metavar="SPM", help="Strokes per minute; 20,34 goes from 20 to 34.")
    ] = "24",
    condition: Annotated[
        str | None,
        typer.Option(
            "--condition",
            metavar="S-NB|B-NB|S-B|B-B",
            help="S boat still, B surging; NB sensors without, B with constant biases. Default B-B.",
        ),
    ] = None,
    boat: Annotated[
        BoatMotion | None,
        typer.Option(
            "--hull",
            help="still; surge; pitch: surge, and pitch under the rower; rotating: surge, and rotations as given. "
            "Default: as the condition says.",
        ),
    ] = None,
    hull_pitch_rad: Annotated[
        float | None, _amplitude("--hull-pitch-rad", "Pitch", "0.0052 (0.3 deg)")
    ] = None,
    hull_roll_rad: Annotated[float | None, _amplitude("--hull-roll-rad", "Roll", "0.026 (1.5 deg)")] = None,
    hull_yaw_rad: Annotated[float | None, _amplitude("--hull-yaw-rad", "Yaw", "0.0087 (0.5 deg)")] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of stroke variation and noise.")] = 0,
    session: Annotated[
        bool,
        typer.Option(
            "--calibration-session",
            help="Simulate a guided calibration session; see calibrate session. The default for bodies without a seat "
            "and oars.",
        ),
    ] = False,
    pose: Pose = "N",
    field: Field = None,
    effect: Effect = None,
    strength: Strength = 1.0,
    rate_hz: RateHz = 125.0,
    settings: Settings = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    sensors: Sensors = None,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Simulate a rower, or a person's calibration session: write a recording, and the ground truth into truth/."""
    from oarlock.rowing.simulation.experiment import simulate_rowing

    loaded = chosen_body(model, assignments(settings, "--set"), stature_m, mass_kg, sensors)
    if not (session or field or effect or boat or condition) and not _rows(loaded):
        session = True
        if not json_output:
            say(
                f'"{loaded.name}" is no rower: this simulates its calibration session, as with --calibration-session.'
            )
    if session:
        simulate_guided_session(loaded, out, model, pose, seed, force, json_output)
        return
    chosen = _condition(condition, boat)
    rates = _rates(rate_spm)
    amplitudes = {"pitch_rad": hull_pitch_rad, "roll_rad": hull_roll_rad, "yaw_rad": hull_yaw_rad}
    rotation = _rotation(boat, {name: value for name, value in amplitudes.items() if value is not None})
    effects = asked_effects(field, effect, strength, rate_hz)
    if effects is not None and boat in (BoatMotion.pitch, BoatMotion.rotating):
        raise UsageError(
            f"--hull {boat.value} with --field: there the hull turns by --effect hull_pitch_rad=0.01"
        )
    if effects is not None:
        simulate_in_the_field(
            loaded, effects, out, (chosen, duration_s, rates, rate_hz, seed), model, force, json_output
        )
        return
    with output_folder(out, "recording", force) as stage, progress("simulating"):
        truth, recording = simulate_rowing(
            loaded,
            chosen,
            duration_s,
            rates,
            seed,
            hull_rotation=rotation,
            pitching=boat is BoatMotion.pitch,
        )
        recording.save(stage)
        truth.save(stage / "truth")
    if json_output:
        print_json({"recording": out, "truth": out / "truth", "streams": recording.names, "seed": seed})
        return
    say(f"Wrote {out}", style="bold")
    pairs(
        [
            ("recording", f"{out}  ({recording.start_s:.1f} to {recording.end_s:.1f} s)"),
            ("streams", ", ".join(recording.names)),
            ("truth", out / "truth"),
        ]
    )
    steps(
        f"oarlock track {out} --model {model} --out {out}-track",
        f"oarlock evaluate {out}-track {out}/truth",
    )


def _rows(model: Model) -> bool:
    return "seat" in {joint.name for joint in model.describe().joints}


def _condition(condition: str | None, boat: BoatMotion | None) -> str:
    """Return the column of Table 5. If both flags are given, they must agree."""
    from oarlock.rowing import CONDITIONS

    still = boat is BoatMotion.still
    name = condition or ("S-B" if still else "B-B")
    if name not in CONDITIONS:
        raise UsageError(f"--condition {name}: choose one of {', '.join(CONDITIONS)}")
    if boat is not None and CONDITIONS[name].boat_surge is still:
        raise UsageError(
            f"--condition {name} with --hull {boat.value}: S- is a stationary boat, B- a surging one. "
            "Give only one of the two"
        )
    return name


def _rotation(boat: BoatMotion | None, amplitudes: dict[str, float]) -> HullRotation | None:
    from oarlock.rowing import HullRotation

    if boat is BoatMotion.rotating:
        return HullRotation(**amplitudes)
    if amplitudes:
        flags = ", ".join(f"--hull-{name.replace('_', '-')}" for name in amplitudes)
        raise UsageError(f"{flags}: only with --hull rotating")
    return None


def _rates(text: str) -> float | tuple[float, ...]:
    try:
        rates = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--rate-spm {text}: expected a number, or two with a comma such as 20,34") from None
    return rates[0] if len(rates) == 1 else rates


def simulate_guided_session(
    model: Model, out: Path, named: str, pose: str, seed: int, force: bool, json_output: bool
) -> None:
    """Writes a recording of a person who follows the model's plan, and the ground truth."""
    from oarlock.calibration import default_plan
    from oarlock.simulation import simulate_session

    with output_folder(out, "recording", force) as stage, progress("simulating"):
        trial = simulate_session(model, default_plan(model, pose), seed=seed)
        trial.save(stage)
    names = trial.recording.names
    absent = [one.name for one in model.describe().sensors if one.name not in names and one.kind != "closure"]
    if json_output:
        print_json(
            {"recording": out, "truth": out / "truth", "streams": names, "absent": absent, "seed": seed}
        )
        return
    say(f"Wrote {out}", style="bold")
    pairs(
        [
            ("recording", f"{out}  ({trial.recording.start_s:.1f} to {trial.recording.end_s:.1f} s)"),
            ("streams", ", ".join(names)),
            ("not simulated", ", ".join(absent)),
            ("plan", out / "plan.toml"),
            ("true mounts and biases", out / "true_calibration.toml"),
        ]
    )
    taken = "" if pose == "N" else f" --pose {pose}"
    steps(f"oarlock calibrate session {out} --model {named}{taken} --out {out}-cal.toml")
