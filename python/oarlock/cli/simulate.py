"""`oarlock simulate`: simulates a rower's recording with its ground truth."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.body import Mass, Pose, Sensors, Stature, chosen_body
from oarlock.cli.options import Force, Json, ModelName, OutFolder, Settings, assignments, example
from oarlock.cli.simulate_field import Effect, Field, RateHz, Strength, asked_effects, simulate_in_the_field
from oarlock.cli.simulate_session import simulate_guided_session
from oarlock.cli.terminal import UsageError, output_folder, pairs, print_json, progress, say, steps, verb

if TYPE_CHECKING:
    from oarlock import Model
    from oarlock.rowing import HullRotation


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
