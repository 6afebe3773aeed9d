"""`calibrate_hinge_axes`: mounts from the hinge axes that motion shows.

The search itself is the engine's (`calibrate::hinge_axes`); docs/mounts.md explains it and shows an example.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock import _core
from oarlock.calibration.static.link_pairs import ROOT, LinkPair, link_pairs
from oarlock.calibration.static.worn_model import Worn
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.storage.array_gate import FloatArray
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

SEARCH = "hinge axes"

WELL_KNOWN_RAD = np.radians(10.0)
"""An axis that is known less well turns no mount."""

CLEAR_SENSE = 0.1
"""From here on the motion determines the common sense of the two axes."""

Sight = tuple[list[float], list[float], float]


def calibrate_hinge_axes(
    model: Model,
    recording: Recording,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    window_s: float = 0.1,
    root_at_rest: bool | None = None,
) -> Calibration:
    """Turn mounts so that hinges lie where the motion shows them.

    Wherever a single hinge lies between two units, their gyroscopes give its axis in both. A mount is turned by
    the least angle that brings the axes of its hinges to those of the model: with one hinge the turn about it
    stays nominal, with two that are not parallel the mount is fully determined.

    Args:
        model: says which hinges lie between which units, and their axes.
        recording: gyroscope and accelerometer of the units. Both bodies should turn, not only one about the hinge.
        sensors: the units to use, one a body; None takes all of the model that were recorded.
        calibration: mounts and lengths to start from; None takes the model's. Nominal mounts within 90 deg of the
            truth tell the two ends of an axis apart.
        window_s: over which the gyroscopes are averaged, s.
        root_at_rest: whether hinges between the root and the first units are found too; None: if the model has
            neither a base acceleration nor a free joint.

    Returns:
        The starting calibration with turned mounts. ``noted`` holds each axis, its standard deviation, by how much
        the mount was turned, and undetermined axes.

    Raises:
        DataError: no two units with a single hinge between them, two units on one body, a stream without
            gyroscope or accelerometer, or no common stretch of time; with names and figures.
    """
    names = chosen_units(model, recording, sensors, SEARCH)
    recording = corrected(recording, calibration)
    require_plausible(recording.only(names))
    worn = Worn.of(model, calibration)
    pairs = [p for p in link_pairs(worn.model, names, SEARCH, root_at_rest) if p.axis is not None]
    if not pairs:
        raise DataError(
            f"{SEARCH}: no single hinge lies between two of the units {', '.join(names)} of "
            f'"{model.name}". Put a unit on both sides of a hinge, or name other sensors.'
        )
    sights: dict[str, list[Sight]] = {}
    joints, unknown = {}, []
    for pair in pairs:
        found = _core.find_hinge_axis(*worn.read(pair, recording), window_s)
        seen = _sights(pair, found, worn)
        joints[pair.label] = _joint_note(pair, found, seen)
        for name, sight in seen.items():
            if sight[2] < WELL_KNOWN_RAD:
                sights.setdefault(name, []).append(sight)
            elif name != ROOT:
                unknown.append(f"{name}: axis of {pair.label}")
    turned = {
        name: _core.align_mount(worn.rotations[name].tolist(), seen)
        for name, seen in sights.items()
        if name != ROOT
    }
    mounts = {name: (np.array(t["link_from_sensor"]), worn.offsets[name]) for name, t in turned.items()}
    noted = {
        "how": "hinge axes from motion",
        "joint": joints,
        "sensor": {n: {k: t[k] for k in ("turned_rad", "left_rad")} for n, t in turned.items()},
        "kept_nominal": unknown,
        "left_out": [name for name in recording.names if name not in names],
    }
    return worn.calibrated(mounts, noted)


def _sights(pair: LinkPair, found: Mapping[str, Any], worn: Worn) -> dict[str, Sight]:
    """The axis in each unit's sensor and link, the end nearer to the nominal mount's."""
    assert pair.axis is not None
    sights = {}
    ends = zip(pair.units, ("first", "second"), pair.axis.reshape(2, 3), found["std_rad"], strict=True)
    for name, key, in_link, std in ends:
        in_sensor = _nearer(np.asarray(found[key]), worn.rotations[name].T @ in_link)
        sights[name] = (in_sensor.tolist(), in_link.tolist(), float(std))
    return sights


def _nearer(axis: FloatArray, to: FloatArray) -> FloatArray:
    return axis if axis @ to >= 0.0 else -axis


def _joint_note(pair: LinkPair, found: Mapping[str, Any], seen: Mapping[str, Sight]) -> dict[str, Any]:
    """Texts, numbers and tables only, so that a file can hold them."""
    signs = [
        np.sign(np.dot(found[key], sight[0]))
        for key, sight in zip(("first", "second"), seen.values(), strict=True)
    ]
    clear = pair.parent != ROOT and found["sense"] > CLEAR_SENSE
    return {
        "parent": pair.parent,
        "child": pair.child,
        "axis_in_parent_sensor": seen[pair.parent][0],
        "axis_in_child_sensor": seen[pair.child][0],
        **{key: found[key] for key in ("std_rad", "residual_rad_s", "hinge_rad_s", "sense")},
        "ends_contradict": bool(clear and signs[0] != signs[1]),
    }
