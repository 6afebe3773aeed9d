"""`oarlock simulate`: a rower's recording, or a guided calibration session of any body, with the ground truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from oarlock.cli.terminal import UsageError, heading, output_folder, pairs, progress, say, steps, table
from oarlock.cli.verbs import NewFolder, command

if TYPE_CHECKING:
    from oarlock import Model, Recording
    from oarlock.cli.body import Body
    from oarlock.rowing import FieldEffects, HullRotation


@dataclass(frozen=True)
class Simulated:
    """What was written.

    Attributes:
        recording: folder.
        truth: folder of the ground truth.
        streams: names.
        seed: of variation and noise.
        start_s: of the recording.
        end_s: of the recording.
        files: further files, by what they have.
        effects: strengths of field errors.
        absent: sensors of the model that are not simulated.
        body: options that chose the model.
        pose: still pose of a guided session.
    """

    recording: Path
    truth: Path
    streams: tuple[str, ...]
    seed: int
    start_s: float
    end_s: float
    files: dict[str, Path]
    effects: dict[str, float]
    absent: list[str]
    body: str
    pose: str = ""

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        written = {"recording": self.recording, "truth": self.truth, **self.files}
        return {
            **written,
            "streams": self.streams,
            "absent": self.absent,
            "seed": self.seed,
            "effects": self.effects,
        }


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
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
        show=_show,
        metavars={"rate_spm": "SPM"},
        defaults={"model": "sculler"},
    )(simulate)


def simulate(
    *,
    out: NewFolder,
    model: Body,
    duration_s: float = 40.0,
    rate_spm: str = "24",
    condition: Literal["S-NB", "B-NB", "S-B", "B-B"] | None = None,
    hull: Literal["still", "surge", "pitch", "rotating"] | None = None,
    hull_pitch_rad: float | None = None,
    hull_roll_rad: float | None = None,
    hull_yaw_rad: float | None = None,
    seed: int = 0,
    calibration_session: bool = False,
    pose: Literal["N", "T", "sitting"] = "N",
    field: Literal["careful", "wild", "misfit", "off"] | None = None,
    effect: dict[str, float] | None = None,
    strength: float = 1.0,
    rate_hz: float = 125.0,
    force: bool = False,
) -> Simulated:
    """Simulate a rower, or a person's calibration session: write a recording, and the ground truth into truth/.

    Args:
        out: folder to write.
        model: the body.
        duration_s: length, s.
        rate_spm: strokes per minute; 20,34 goes from 20 to 34.
        condition: S boat still, B surging; NB sensors without, B with constant biases. Default B-B.
        hull: still; surge; pitch: surge, and pitch under the rower; rotating: surge, and rotations as given. Default:
            as the condition says.
        hull_pitch_rad: pitch of a rotating hull, amplitude, rad. Default 0.0052 (0.3 deg).
        hull_roll_rad: roll of a rotating hull, amplitude, rad. Default 0.026 (1.5 deg).
        hull_yaw_rad: yaw of a rotating hull, amplitude, rad. Default 0.0087 (0.5 deg).
        seed: seed of stroke variation and noise.
        calibration_session: simulate a guided calibration session; see calibrate session. The default for bodies
            without a seat and oars.
        pose: still pose of the session: N (arms hanging), T (arms level) or sitting.
        field: preset of field errors: careful session, large errors, wrong mounts and lengths, or only --effect.
        effect: strength of one effect, SI units. Repeatable; needs --field.
        strength: factor on all effects of --field: 0 none, 1 unchanged.
        rate_hz: rate of all sensors; needs --field.
        force: replace what is there.
    """
    body = model.model
    is_rower = "seat" in {joint.name for joint in body.describe().joints}
    is_guided = calibration_session or not (is_rower or field or effect or hull or condition)
    if is_guided and not calibration_session:
        say(
            f'"{body.name}" is no rower: this simulates its calibration session, as with --calibration-session.'
        )
    effects = _effects(field, effect or {}, strength, rate_hz)
    if effects is not None and hull in ("pitch", "rotating"):
        raise UsageError(f"--hull {hull} with --field: there the hull turns by --effect hull_pitch_rad=0.01")
    chosen = _condition(condition, hull)
    rotation = _rotation(hull, pitch_rad=hull_pitch_rad, roll_rad=hull_roll_rad, yaw_rad=hull_yaw_rad)
    rates = _rates(rate_spm)
    files: dict[str, Path] = {}
    absent: list[str] = []
    with output_folder(out, "recording", force) as stage, progress("simulating"):
        if is_guided:
            recording = _guided_session(body, pose, seed, stage)
            names = recording.names
            sensors = [sensor for sensor in body.describe().sensors if sensor.kind != "closure"]
            absent = [sensor.name for sensor in sensors if sensor.name not in names]
            files = {"plan": out / "plan.toml", "true_calibration": out / "true_calibration.toml"}
        elif effects is not None:
            from oarlock.rowing import simulate_field

            trial = simulate_field(
                body,
                effects,
                condition=chosen,
                duration_s=duration_s,
                rate_spm=rates,
                rate_hz=rate_hz,
                seed=seed,
            )
            trial.save(stage)
            recording = trial.recording
            files = {"markers": out / "markers.csv", "true_calibration": out / "true_calibration.toml"}
        else:
            from oarlock.rowing.simulation.experiment import simulate_rowing

            truth, recording = simulate_rowing(
                body,
                chosen,
                duration_s,
                rates,
                seed,
                hull_rotation=rotation,
                pitching=hull == "pitch",
            )
            recording.save(stage)
            truth.save(stage / "truth")
    return Simulated(
        out,
        out / "truth",
        recording.names,
        seed,
        recording.start_s,
        recording.end_s,
        files,
        {} if effects is None else effects.strengths(),
        absent,
        model.words,
        pose if is_guided else "",
    )


def _guided_session(body: Model, pose: str, seed: int, folder: Path) -> Recording:
    """Writes a recording of a person who follows the model's plan, with the ground truth."""
    from oarlock.calibration import default_plan
    from oarlock.simulation import simulate_session

    trial = simulate_session(body, default_plan(body, pose), seed=seed)
    trial.save(folder)
    return trial.recording


def _effects(
    field: str | None, effect: dict[str, float], strength: float, rate_hz: float
) -> FieldEffects | None:
    """The effects that the options select; None without `--field`.

    Raises:
        UsageError: an unknown effect, or options that need `--field`.
        DataError: a strength out of range.
    """
    from oarlock.rowing.simulation.simulators import PRESETS

    if field is None:
        if effect or strength != 1.0 or rate_hz != 125.0:
            raise UsageError("--effect, --strength and --rate-hz need --field, for example --field careful")
        return None
    known = PRESETS["off"].strengths()
    if unknown := [name for name in effect if name not in known]:
        raise UsageError(f"--effect {unknown[0]}: no such effect. There are {', '.join(known)}")
    return replace(PRESETS[field].scaled(strength), **effect)


def _condition(condition: str | None, hull: str | None) -> str:
    """The column of Table 5. If both options are given, they must agree."""
    from oarlock.rowing import CONDITIONS

    is_still = hull == "still"
    name = condition or ("S-B" if is_still else "B-B")
    if hull is not None and CONDITIONS[name].boat_surge is is_still:
        raise UsageError(
            f"--condition {name} with --hull {hull}: S- is a stationary boat, B- a surging one. "
            "Give only one of the two"
        )
    return name


def _rotation(hull: str | None, **amplitudes: float | None) -> HullRotation | None:
    from oarlock.rowing import HullRotation

    chosen = {name: value for name, value in amplitudes.items() if value is not None}
    if hull == "rotating":
        return HullRotation(**chosen)
    if chosen:
        flags = ", ".join(f"--hull-{name.replace('_', '-')}" for name in chosen)
        raise UsageError(f"{flags}: only with --hull rotating")
    return None


def _rates(text: str) -> float | tuple[float, ...]:
    try:
        rates = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--rate-spm {text}: expected a number, or two with a comma such as 20,34") from None
    return rates[0] if len(rates) == 1 else rates


def _show(result: Simulated) -> None:
    out = result.recording
    say(f"Wrote {out}", style="bold")
    files = {name.replace("_", " "): str(file) for name, file in result.files.items()}
    if "markers" in files:
        files["markers"] += "  (true centres of shoulders, elbows and wrists)"
    pairs(
        [
            ("recording", f"{out}  ({result.start_s:.1f} to {result.end_s:.1f} s)"),
            ("streams", ", ".join(result.streams)),
            ("not simulated", ", ".join(result.absent)),
            ("truth", result.truth),
            *files.items(),
        ]
    )
    if result.effects:
        _show_effects(result.effects)
    if result.pose:
        pose = "" if result.pose == "N" else f" --pose {result.pose}"
        steps(f"oarlock calibrate session {out} {result.body}{pose} --out {out}-cal.toml")
    else:
        track = f"{out}-track"
        steps(f"oarlock track {out} {result.body} --out {track}", f"oarlock evaluate {track} {result.truth}")


def _show_effects(strengths: dict[str, float]) -> None:
    from oarlock.rowing.field.effects import GROUPS, FieldEffects

    off = FieldEffects.off().strengths()
    heading("Effects that are on", "m, rad, s and uT; without unit: share")
    on = {
        group: [f"{name} {strengths[name]:.4g}" for name in names if strengths[name] != off[name]]
        for group, names in GROUPS.items()
    }
    table(
        ["effect", "strength"],
        [(group.replace("_", " "), ", ".join(values)) for group, values in on.items() if values],
    )
