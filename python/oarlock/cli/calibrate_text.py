"""What the verbs of `calibrate` print: mounts, joints, lengths, field and clocks with their standard deviations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from oarlock.cli.terminal import heading, number, say, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from oarlock import Calibration

EXAMPLE_PLAY_DEG = 3.0
"""What docs/mounts.md recommends to begin with."""
HEADINGS = {
    "movement": "its movement",
    "movement, either way": "its movement; forward or backward is not determined",
    "two hinges": "both hinges between the units",
    "north": "north of the other units",
    "nominal": "the model (not found)",
}


def write_chain(calibration: Calibration) -> None:
    """Prints the uncertainty of each mount, the lengths, and what keeps the model's nominal value."""
    noted: dict[str, Any] = dict(calibration.noted)
    start, end = noted["still_s"]
    heading("Mounts", f"stationary from {start:.2f} to {end:.2f} s")
    table(
        [
            "sensor",
            "hinge",
            ">from/to deg",
            ">std about hinge, up, third deg",
            ">gravity-axis deg",
            ">off axis %",
        ],
        [
            (
                name,
                found["joint"],
                _degrees(found["swing_range_rad"], "+.0f"),
                _degrees([found[f"std_about_{turn}_rad"] for turn in ("hinge", "up", "third")], ".1f"),
                _degrees([found["disagreement_rad"]], "+.1f"),
                number(100.0 * found["off_axis_share"], ".2f"),
            )
            for name, found in noted["sensor"].items()
        ],
    )
    heading("Sensor positions", "in axes of the link's frame; magnetometer in sensor axes")
    table(
        ["sensor", ">offset mm", ">accel residual m/s2", ">magnetometer offset uT", ">field residual uT"],
        [
            (
                name,
                ", ".join(f"{1e3 * x:.0f}" for x in calibration.mounts[name][1]),
                number(found.get("residual_m_s2"), ".2f"),
                _offset(found),
                _residuals(found),
            )
            for name, found in noted["sensor"].items()
        ],
    )
    for parameter, value in calibration.parameters.items():
        say(f"{parameter} = {value:.3f} m", indent=2)
    for title, lines in (
        ("kept at the model's nominal value", noted["kept_nominal"]),
        ("not used", noted["left_out"]),
    ):
        if lines:
            say(f"{title}: {'; '.join(lines)}", style="dim", indent=2)


def _offset(found: dict[str, Any]) -> str:
    if "mag_offset_ut" not in found:
        return ""
    text = ", ".join(f"{x:.1f}" for x in found["mag_offset_ut"])
    return text if found["mag_offset_used"] else f"({text}) not used"


def _residuals(found: dict[str, Any]) -> str:
    if "mag_offset_ut" not in found:
        return ""
    return f"{found['mag_residual_without_ut']:.1f} without, {found['mag_residual_ut']:.1f} with"


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


def write_sagittal(found: Calibration) -> None:
    """Prints one line for each unit."""
    import numpy as np

    from oarlock.pipeline import balls_of

    noted: Any = found.noted
    start_s, end_s = noted["still_s"]
    say(f"stood still from {start_s:.2f} to {end_s:.2f} s", indent=2)
    table(
        ["unit", "heading from", ">std deg", ">about one axis %"],
        [
            (
                name,
                HEADINGS[unit["heading_by"]],
                number(np.degrees(unit["heading_std_rad"]), ".0f"),
                number(100 * unit["share_about_one_axis"], ".0f"),
            )
            for name, unit in noted["sensor"].items()
        ],
    )
    for pair in noted["two_hinges"]:
        if pair["refused"]:
            say(f"axes of {' and '.join(pair['joints'])} not found: {pair['refused']}", indent=2)
    for pair in balls_of(found):
        say(f"track these as one ball joint: --ball {','.join(pair)}", indent=2)


def write_clocks(calibration: Calibration) -> None:
    """Prints each clock with its standard deviations, and the clocks that were not determined."""
    noted: dict[str, Any] = dict(calibration.noted)["clocks"]  # type: ignore[assignment]
    heading("Clocks", f"against {', '.join(noted['reference'])}; positive: late, fast")
    table(
        ["stream", ">offset ms", ">std ms", ">drift ppm", ">std ppm"],
        [
            (
                name,
                number(1e3 * clock.offset_s, "+.2f"),
                number(1e3 * clock.offset_std_s, ".2f"),
                number(1e6 * clock.drift, "+.1f"),
                number(1e6 * clock.drift_std, ".1f"),
            )
            for name, clock in calibration.clocks.items()
        ],
    )
    for name, why in noted["refused"].items():
        say(f"{name}: {why}", style="dim", indent=2)


def write_motion(calibration: Calibration) -> None:
    """Prints which of the results applies and why, and every constant with its prior."""
    noted: dict[str, Any] = dict(calibration.noted)
    start, end = noted["held_out_s"]
    heading(
        "Held-out innovations",
        f"normalised, squared, per reading, {start:.1f} to {end:.1f} s; smaller is better",
    )
    table(["calibration", ">NIS"], [(name, number(x, ".3f")) for name, x in noted["scores"].items()])
    kept = noted["kept"]
    if kept == "before":
        say("Kept: the earlier values. No candidate explained the held-out data better.", indent=2)
        return
    say(f"kept: {kept}", indent=2)
    heading("Constants", "mm and deg; explained: reduction of the prior variance by the movement")
    table(
        ["constant", ">prior", ">std", ">found", ">std", ">explained %"],
        [_constant_row(name, found) for name, found in noted["constant"].items()],
    )
    if noted["not_told"]:
        say(f"hardly determined: {', '.join(noted['not_told'])}", style="dim", indent=2)


def _constant_row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    scale, style = (180.0 / math.pi, ".2f") if found["unit"] == "rad" else (1e3, ".1f")
    figures = (number(scale * found[key], style) for key in ("prior", "prior_std", "found", "std"))
    return (name, *figures, number(100.0 * found["share_told"], ".0f"))


def _millimetres(values_m: list[float]) -> str:
    return ", ".join(f"{1e3 * value:.0f}" for value in values_m)


def _degrees(angles_rad: Sequence[float], style: str = ".1f") -> str:
    return ", ".join(format(math.degrees(angle), style) for angle in angles_rad)
