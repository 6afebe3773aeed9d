"""Finds inertial units among channels with labels and units, for the readers of XDF and of analogue C3D channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from oarlock.formats.arbitrary_units import ARBITRARY, scaled_mag
from oarlock.formats.table.header import Quantity, channel_of
from oarlock.storage.arrays import Floats
from oarlock.storage.units import to_held_unit

_FIELDS: Mapping[Quantity, str] = {"gyro": "gyro_rad_s", "accel": "accel_m_s2", "mag": "mag_ut"}


@dataclass(frozen=True)
class Triple:
    """Three channels that are one quantity of one inertial unit.

    Args:
        unit: name of the inertial unit; empty if the labels name none.
        field: of an `ImuStream`.
        places: of the channels for x, y, z.
        measured_in: their unit of measurement.
    """

    unit: str
    field: str
    places: tuple[int, int, int]
    measured_in: str


def inertial_fields(
    triples: Sequence[Triple], values: Floats, name: str
) -> tuple[dict[str, Floats], Floats | None, list[str]]:
    """The fields of an `ImuStream` from the triples of one unit.

    Args:
        triples: of the unit.
        values: (T, channels) as the file has them.
        name: of the stream, for notes.

    Returns:
        The fields in the units of a stream; the readings of a magnetometer in arbitrary units; notes.
    """
    fields: dict[str, Floats] = {}
    arbitrary, notes = None, []
    for triple in triples:
        rows = values[:, triple.places]
        if triple.measured_in != ARBITRARY:
            fields[triple.field] = to_held_unit(rows, triple.measured_in)
            continue
        arbitrary = rows
        scaled, note = scaled_mag(rows, name)
        notes.append(note)
        fields |= {} if scaled is None else {triple.field: scaled}
    return fields, arbitrary, notes


def inertial_triples(labels: Sequence[str], units: Sequence[str]) -> tuple[list[Triple], list[str]]:
    """The triples among channels, and sentences on those that lack an axis or a unit of measurement.

    Args:
        labels: of the channels, such as "AccX".
        units: of measurement, in the same order; empty where the file says none.
    """
    axes: dict[tuple[str, Quantity], dict[str, tuple[int, str | None]]] = {}
    for place, (label, unit) in enumerate(zip(labels, units, strict=True)):
        found = channel_of(label, unit)
        # A moment "Mx1" in Nmm is no magnetometer: a unit of another quantity decides.
        is_other = found is not None and found.measured_in is None and unit.strip() != ""
        if found is not None and not is_other and found.quantity in _FIELDS:
            axes.setdefault((found.unit, found.quantity), {}).setdefault(
                found.axis, (place, found.measured_in)
            )
    triples, said = [], []
    for (unit, quantity), found_axes in axes.items():
        name = " ".join(filter(None, (unit, quantity)))
        if set(found_axes) != set("xyz"):
            said.append(f"{name} has no three axes and was kept as plain channels.")
            continue
        (x, in_x), (y, in_y), (z, in_z) = (found_axes[axis] for axis in "xyz")
        if in_x is None or not in_x == in_y == in_z:
            said.append(f"{name} has no unit of measurement in the file and was kept as plain channels.")
            continue
        triples.append(Triple(unit, _FIELDS[quantity], (x, y, z), in_x))
    return triples, said
