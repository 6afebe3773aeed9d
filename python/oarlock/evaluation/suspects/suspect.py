"""A probable fault of sensors (`Suspect`) and its texts: the fault, and what to change in which file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, isfinite, isnan, nan

import numpy as np

from oarlock.storage.arrays import Floats

SUSPECT_NOTE = "Suspect: "
"""First word of a track's note that names a suspect."""
USUAL = 0.5
"""Largest misfit of a second that the usual errors of real recordings explain."""

_QUANTITY = {"gyro_rad_s": "gyro", "accel_m_s2": "accel", "mag_ut": "mag", "value": "value"}
_SENSOR = {"gyro_rad_s": "gyroscope", "accel_m_s2": "accelerometer", "mag_ut": "magnetometer"}
_MAPPING_UNIT = {
    "in deg/s": "deg/s",
    "in g": "g",
    "in mg": "mg",
    "in degrees": "deg",
    "in cm": "cm",
    "in mm": "mm",
}
_MAPPING_UNIT |= {"in gauss": "gauss", "in mG": "mG", "in nT": "nT"}


@dataclass(frozen=True)
class Suspect:
    """A probable sensor fault. The recording is not changed.

    Args:
        streams: names of the affected streams.
        fault: "exchanged", "unit", "sign", "turned", "axes", "clock", "mount", "bias", "scale", "stuck", "clipped",
            "reading", "contradicts", "untold", or "unfinished".
        message: the fault, and what to change.
        misfit_before: squared innovations relative to those from the usual errors of real recordings; up to 0.5 is
            usual. NaN if the stream alone shows the fault.
        misfit_after: the same after the change.
        start_s: start of the second that shows the fault, s.
        others: other faults that explain the readings nearly as well.
        error_rad: by how much the orientation of its units is wrong if nothing is changed, rad; NaN if unknown.
    """

    streams: tuple[str, ...]
    fault: str
    message: str
    misfit_before: float = nan
    misfit_after: float = nan
    start_s: float = nan
    others: tuple[str, ...] = ()
    error_rad: float = nan

    @property
    def note(self) -> str:
        """The text for the notes of a track."""
        return str(self) if self.fault in ("untold", "unfinished") else f"{SUSPECT_NOTE}{self}"

    def to_dict(self) -> dict[str, object]:
        """Plain values for JSON; None where unknown."""
        values = {
            name: getattr(self, name) for name in ("misfit_before", "misfit_after", "start_s", "error_rad")
        }
        known = {name: value if isfinite(value) else None for name, value in values.items()}
        texts = {"fault": self.fault, "message": self.message, "others": list(self.others)}
        return {"streams": list(self.streams), **texts, **known}

    def __str__(self) -> str:
        numbers = ""
        if isfinite(self.misfit_after):
            usual = f"; up to {USUAL} is usual" if isnan(self.error_rad) else ""
            before, after = _number(self.misfit_before), _number(self.misfit_after)
            numbers = f" Misfit {before} as recorded, {after} after this change{usual}."
        others = f" Nearly as well fits: {' Or: '.join(self.others)}" if self.others else ""
        return f"{self.message}{numbers}{others}"


def of_units(
    fault: str,
    streams: tuple[str, ...],
    text: str,
    error_rad: float,
    misfits: tuple[float, float] = (nan, nan),
    from_s: float = nan,
    others: tuple[str, ...] = (),
) -> Suspect:
    """A fault that units show of themselves or of each other, with what follows for the angles."""
    since = "" if isnan(from_s) else f" This begins at about {from_s:.0f} s."
    rate = " a second" if fault == "bias" and "gyroscope" in text else ""
    message = (
        f"{text}{since} Until it is mended, {' and '.join(streams)} can be off by about {degrees(error_rad):.0f} "
        f"deg{rate}, and angles of its joints by more than their bands."
    )
    return Suspect(streams, fault, message, *misfits, from_s, others, error_rad)


def exchange_text(pairs: Sequence[tuple[str, str]]) -> str:
    """Text for exchanged streams."""
    looks = "; and ".join(f"{a} and {b} look exchanged" for a, b in pairs)
    return f"{looks}. Give each the other's name where the recording is imported."


def factor_text(streams: Sequence[str], quantity: str, what: str, factor: float) -> str:
    """Text for readings in a wrong unit or with a wrong sign."""
    key = _QUANTITY[quantity]
    subject = _of(streams, quantity)
    if (unit := _MAPPING_UNIT.get(what)) is not None:
        advice = f'set unit = "{unit}" for {key} in the mapping file, or multiply by {factor:.6g}'
    elif factor == -1.0 and quantity != "value":
        advice = f'set axes = ["-x", "-y", "-z"] for {key} in the mapping file'
    else:
        advice = f"set scale = {factor:.6g} for {key} in the mapping file"
    return f"{subject} {_look(streams)} {what}: {advice}."


def stuck_text(name: str, value: float) -> str:
    """Text for an encoder with constant readings."""
    return f"{name} looks stuck: it reads {value:.5g} throughout. Check the sensor; until then leave it out."


def turn_text(streams: Sequence[str], matrix: Floats) -> str:
    """Text for an inertial unit that is mounted in another orientation."""
    name = streams[0] if len(streams) == 1 else "NAME"
    half_turn = abs(np.trace(matrix) + 1.0) < 0.5 and np.linalg.det(matrix) > 0
    upside, them = ", upside down," if half_turn else "", "it" if len(streams) == 1 else "them"
    return (
        f"{_of(streams)} {_look(streams)} mounted{upside} turned by {angle_text(matrix)}. Turn {them}, or set "
        f"axes = {axes_list(matrix)} for gyro, accel and mag in the mapping file, or put mounts.{name}.rotation times "
        f"{_rows(matrix)} into the calibration."
    )


def axes_text(streams: Sequence[str], quantities: Sequence[str], matrix: Floats) -> str:
    """Text for readings in axes of another convention."""
    one = quantities[0] if len(quantities) == 1 else ""
    keys = _QUANTITY[one] if one else "gyro, accel and mag"
    what = f"turned by {angle_text(matrix)}" if np.linalg.det(matrix) > 0 else mirror_text(matrix)
    subject = _of(streams, one)
    advice = f"set axes = {axes_list(matrix)} for {keys} in the mapping file"
    return f"{subject} {_look(streams)} in other axes ({what}): {advice}."


def _of(streams: Sequence[str], quantity: str = "") -> str:
    names = ", ".join(streams)
    if quantity in _SENSOR:
        return f"{_SENSOR[quantity]}{'s' if len(streams) > 1 else ''} of {names}"
    return names


def _look(streams: Sequence[str]) -> str:
    return "looks" if len(streams) == 1 else "look"


def angle_text(matrix: Floats) -> str:
    """`180 deg about its x`: the rotation of the readings from recorded to correct axes."""
    cosine = (np.trace(matrix) - 1.0) / 2.0
    angle = round(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    if angle == 180:
        values, vectors = np.linalg.eigh(matrix + matrix.T)
        axis = vectors[:, np.argmax(values)]
    else:
        axis = np.array([matrix[i, j] - matrix[j, i] for i, j in ((2, 1), (0, 2), (1, 0))])
    axis = axis / np.abs(axis).max()
    if angle == 180 and axis[np.flatnonzero(np.abs(axis) > 0.5)[0]] < 0:
        axis = -axis
    return f"{angle} deg about its {_direction(axis)}"


def _direction(axis: Floats) -> str:
    parts = [(value, letter) for value, letter in zip(axis, "xyz", strict=True) if abs(value) > 0.5]
    if len(parts) == 1:
        return ("-" if parts[0][0] < 0 else "") + parts[0][1]
    return "diagonal " + " ".join(("-" if value < 0 else "+") + letter for value, letter in parts)


def mirror_text(matrix: Floats) -> str:
    """`x reversed`, `x and y exchanged`."""
    if np.allclose(matrix, -np.eye(3)):
        return "all three reversed"
    kept = np.flatnonzero(np.diag(matrix) > 0.5)
    if len(kept) == 2:
        return f"{'xyz'[int(np.argmin(np.diag(matrix)))]} reversed"
    return " and ".join("xyz"[i] for i in range(3) if i not in kept) + " exchanged"


def axes_list(matrix: Floats) -> str:
    """`axes` for the mapping file: the recorded axis for each correct axis."""
    found = []
    for row in matrix:
        column = int(np.argmax(np.abs(row)))
        found.append(f'"{"-" if row[column] < 0 else ""}{"xyz"[column]}"')
    return f"[{', '.join(found)}]"


def _rows(matrix: Floats) -> str:
    return str([[round(x) for x in row] for row in matrix]).replace(" ", "")


def _number(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.3g}"
