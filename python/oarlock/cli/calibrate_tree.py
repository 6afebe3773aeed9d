"""`oarlock calibrate joints | axes | pose | field`: single calibration steps for any model."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.options import Json, ModelName, Replace, Settings, assignments, example, names
from oarlock.cli.terminal import free_file, heading, number, print_json, progress, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration, Model, Recording

RecordingFolder = Annotated[Path, typer.Argument(metavar="RECORDING", help="A recording folder.")]
OutFile = Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Calibration file to write.")]
Start = Annotated[
    Path | None,
    typer.Option(
        "--calibration", metavar="FILE", help="An earlier calibration; its mounts are the initial values."
    ),
]
Sensors = Annotated[
    str | None,
    typer.Option(
        "--sensors", metavar="NAMES", help="Sensors to use, comma-separated; default: all recorded."
    ),
]
Window = Annotated[
    float, typer.Option("--window-s", metavar="S", help="Averaging window of the readings, s.")
]
Still = Annotated[
    tuple[float, float] | None,
    typer.Option("--still-s", metavar="START END", help="Stationary interval, s; default: the longest one."),
]

EXAMPLE_PLAY_DEG = 3.0
"""What docs/mounts.md recommends to begin with."""


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    for own, options in (
        (pose, "--out cal.toml"),
        (axes, "--calibration cal.toml --out cal2.toml"),
        (joints, "--window-s 0.3 --out cal.toml"),
        (field, "--out cal.toml"),
    ):
        command = f"oarlock calibrate {own.__name__} rec --model my.toml {options}"
        group.command(own.__name__, epilog=example(command))(own)


@verb
def joints(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    calibration: Start = None,
    sensors: Sensors = None,
    window_s: Window = 0.2,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Calibrate joint centres from motion: sensor positions and lengths between joints."""
    import oarlock

    search = partial(
        oarlock.calibration.calibrate_joint_centers, window_s=window_s, **_known(sensors, calibration)
    )
    calibrated(search, write_joints, recording, model, out, settings, force, json_output)


@verb
def axes(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    calibration: Start = None,
    sensors: Sensors = None,
    window_s: Window = 0.1,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Correct mounts so that hinge axes agree with the motion."""
    import oarlock

    search = partial(
        oarlock.calibration.calibrate_hinge_axes, window_s=window_s, **_known(sensors, calibration)
    )
    calibrated(search, write_axes, recording, model, out, settings, force, json_output)


@verb
def pose(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    calibration: Start = None,
    sensors: Sensors = None,
    still_s: Still = None,
    rest: Annotated[
        list[str] | None,
        typer.Option(
            "--rest",
            metavar="JOINT=VALUE",
            help="Posture, rad; default: the model's rest posture. Repeatable.",
        ),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Correct mounts so that a stationary posture agrees with gravity."""
    import oarlock

    start_s, end_s = still_s or (None, None)
    posture = assignments(rest, "--rest")
    known = _known(sensors, calibration)
    search = partial(oarlock.calibration.calibrate_pose, pose=posture, start_s=start_s, end_s=end_s, **known)
    calibrated(search, write_pose, recording, model, out, settings, force, json_output)


@verb
def field(
    recording: RecordingFolder,
    model: ModelName,
    out: OutFile,
    settings: Settings = None,
    calibration: Start = None,
    sensors: Sensors = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Find the strength and dip of the magnetic field for a model with these parameters."""
    import oarlock

    search = partial(oarlock.calibration.calibrate_field, **_known(sensors, calibration))
    calibrated(search, write_field, recording, model, out, settings, force, json_output)


def _known(sensors: str | None, calibration: Path | None) -> dict[str, Any]:
    import oarlock

    return {
        "sensors": None if sensors is None else names(sensors),
        "calibration": None if calibration is None else oarlock.load_calibration(calibration),
    }


def calibrated(
    search: Callable[[Model, Recording], Calibration],
    write: Callable[[Calibration], None],
    recording: Path,
    model: str,
    out: Path,
    settings: list[str] | None,
    force: bool,
    json_output: bool,
    shows_progress: bool = False,
) -> None:
    """Runs a verb of `calibrate`: loads, searches, saves, and prints the result and the command that tracks with it."""
    import oarlock

    body = oarlock.load_model(model, parameters=assignments(settings, "--set"))
    free_file(out, force)
    with nullcontext() if shows_progress else progress("calibrating"):
        found = search(body, oarlock.load_recording(recording))
    saved(found, write, out, json_output)
    if not json_output:
        steps(track_next(recording, model, out))


def track_next(recording: Path, model: str, out: Path) -> str:
    """The command that tracks with this calibration."""
    return f"oarlock track {recording} --model {model} --calibration {out} --out {recording}-track"


def saved(found: Calibration, write: Callable[[Calibration], None], out: Path, json_output: bool) -> None:
    """Saves a calibration and prints it, as text by `write` or as JSON."""
    found.save(out)
    if json_output:
        print_json({"calibration": out, "parameters": found.parameters, "noted": found.noted})
        return
    say(f"Wrote {out}", style="bold")
    write(found)


# --- what is printed ----------------------------------------------------------------------------------


def write_joints(calibration: Calibration) -> None:
    """Prints the centre of every joint with its standard deviation, and the lengths."""
    noted: dict[str, Any] = dict(calibration.noted)
    heading("Joints", "from the joint to each sensor, in sensor axes")
    table(
        ["joint", "unit", ">mm", ">std mm", ">accel residual m/s2", ">missed mm"],
        [row for name, found in noted["joint"].items() for row in _levers(name, found)],
    )
    for name, found in noted["joint"].items():
        if found["loose"]:
            say(f"{name}: standard deviation above 5 cm in {len(found['loose'])} of 6 directions", indent=2)
    for parameter, std in noted["parameter_std_m"].items():
        say(f"{parameter} = {calibration.parameters[parameter]:.3f} +- {std:.3f} m", indent=2)
    _remarks(
        noted,
        ("without_center", "no centre"),
        ("kept_nominal", "hardly determined by the motion, close to the model's value"),
    )


def write_axes(calibration: Calibration) -> None:
    """Prints the uncertainty of every hinge axis, and the rotation of the mounts."""
    noted: dict[str, Any] = dict(calibration.noted)
    heading("Hinges")
    table(
        ["hinge", "units", ">std deg", ">residual rad/s", ">rotation rad/s", "remark"],
        [
            (
                name,
                f"{found['parent']}, {found['child']}",
                _degrees(found["std_rad"]),
                number(found["residual_rad_s"], ".3f"),
                number(found["hinge_rad_s"], ".2f"),
                _remark(found),
            )
            for name, found in noted["joint"].items()
        ],
    )
    heading("Mounts")
    table(
        ["sensor", ">turned deg", ">std deg about its axes", ">residual deg"],
        [
            (
                name,
                _degrees([f["turned_rad"]]),
                _degrees(calibration.mount_stds_rad[name].tolist()),
                _degrees(f["left_rad"]),
            )
            for name, f in noted["sensor"].items()
        ],
    )
    _remarks(
        noted,
        ("kept_nominal", "hardly determined by the motion, close to the nominal mount"),
        (
            "stays_nominal",
            "the motion differs from the nominal mount by no more than its own uncertainty: unchanged",
        ),
        ("play", "also turns across its axis: play, or a unit that moves on its link"),
    )
    if noted["play"]:
        given = " ".join(f"--play {name}={EXAMPLE_PLAY_DEG:g}" for name in noted["play"])
        say(
            f"Track such hinges with `oarlock track ... {given}`: the play's standard deviation in deg, a guess."
        )


def _remark(found: dict[str, Any]) -> str:
    across = "turns across its axis" if found["turns_across"] else ""
    return "ends contradict the mounts" if found["ends_contradict"] else across


def write_pose(calibration: Calibration) -> None:
    """Prints the rotation of the mounts and the mean readings at rest."""
    noted: dict[str, Any] = dict(calibration.noted)
    start, end = noted["still_s"]
    heading("Mounts", f"stationary from {start:.2f} to {end:.2f} s; the heading stays nominal")
    table(
        ["sensor", ">turned deg", ">std deg", ">gyroscope bias deg/s", ">gravity m/s2"],
        [
            (
                name,
                _degrees([found["turned_rad"]]),
                _degrees([found["std_rad"]]),
                ", ".join(f"{math.degrees(x):+.2f}" for x in found["gyro_bias_rad_s"]),
                number(found["accel_norm_m_s2"], ".3f"),
            )
            for name, found in noted["sensor"].items()
        ],
    )
    _remarks(noted)


def write_field(calibration: Calibration) -> None:
    """Prints the field, its value at each sensor, and the parameters that were set."""
    noted: dict[str, Any] = dict(calibration.noted)
    found = noted["field"]
    heading("Magnetic field", f"{100.0 * found['departing_share']:.0f} % of the time disturbed")
    rows = [("all", found), *noted["sensor"].items()]
    table(
        ["sensor", ">uT", ">dip deg", ">directions", ">off %"],
        [
            (
                name,
                number(unit.get("norm_ut"), ".1f"),
                _degrees([unit["dip_rad"]]) if "dip_rad" in unit else "-",
                unit["directions"],
                number(100.0 * unit["departing_share"], ".0f"),
            )
            for name, unit in rows
        ],
    )
    taken = ", ".join(noted["parameters_of_the_model"])
    say(f"set as {taken}" if taken else "The model has no parameters for strength and dip.", indent=2)
    _remarks(noted)


def _remarks(noted: dict[str, Any], *more: tuple[str, str]) -> None:
    for key, title in (*more, ("left_out", "not used")):
        if noted[key]:
            say(f"{title}: {'; '.join(noted[key])}", style="dim", indent=2)


def _levers(name: str, found: dict[str, Any]) -> list[tuple[str, ...]]:
    """One row for each sensor of a joint; the figures of the joint are in the first row."""
    own = (number(found["residual_m_s2"], ".3f"), number(1e3 * max(found["left_m"]), ".0f"))
    units = [(found["parent"], "first"), (found["child"], "second")]
    # A sensor that represents the resting root has no position of its own.
    placed = [(unit, key) for unit, key in units if not unit.startswith("(")]
    return [
        (
            name if k == 0 else "",
            unit,
            _millimetres(found[f"{key}_m"]),
            _millimetres(found[f"{key}_std_m"]),
            *(own if k == 0 else ("", "")),
        )
        for k, (unit, key) in enumerate(placed)
    ]


def _millimetres(values_m: list[float]) -> str:
    return ", ".join(f"{1e3 * value:.0f}" for value in values_m)


def _degrees(angles_rad: list[float]) -> str:
    return ", ".join(f"{math.degrees(angle):.1f}" for angle in angles_rad)
