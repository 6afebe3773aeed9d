"""`calibrate_hinge_axes`: mounts from the hinge axes that motion shows.

The search itself is the engine's (`calibrate::hinge_axes`); docs/mounts.md explains it and shows an example.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock import _core
from oarlock.calibration.static.link_pairs import ROOT, LinkPair, link_pairs
from oarlock.calibration.static.mounts_of_axes import LikelyMount, SeenAxis, solved_mounts
from oarlock.calibration.static.worn_model import EXACT_STD_RAD, Worn
from oarlock.model.joint_play import hinges_that_can_have_play
from oarlock.model.rotation import angle_between
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

SEARCH = "hinge axes"

CLEAR_SENSE = 0.1
"""From here on the motion determines the common sense of the two axes."""

RIGID_RAD_S, RIGID_TRANSVERSE, RIGID_HINGE = 0.005, 0.01, 0.03
"""Residual that a hinge without play leaves: noise and bias of consumer gyroscopes over a window, rad/s; the 1 % by
which their axes are misaligned, of the rotation normal to the hinge; and of the rotation about it three times as much,
which also leaks in where the axis is a degree off. All are root mean squares over the same windows: a rest dilutes
them alike. More is rotation across the axis, from play or from a unit that moves."""

LITTLE_LEARNT = 0.7
"""An axis of which this share of the nominal standard deviation remains is reported: the motion shows less of it."""


TURNING = ("residual_rms_rad_s", "transverse_rad_s", "hinge_rad_s")
"""Root mean squares over all windows, rad/s."""


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

    Wherever a single hinge lies between two units, their gyroscopes give its axis in both. The mounts found are the
    most likely ones: axes count as far as the motion shows them, nominal mounts with their standard deviation. With one
    hinge the turn about it stays nominal, with two that are not parallel the mount is fully determined.

    Args:
        model: says which hinges lie between which units, and their axes.
        recording: gyroscope and accelerometer of the units. Both bodies should turn, not only one about the hinge.
        sensors: the units to use, one a body; None takes all of the model that were recorded.
        calibration: mounts and lengths to start from; None takes the model's. Its ``mount_stds_rad``, or
            ``mount.std_rad`` of the model file, say how well they are known. Mounts within 90 deg of the truth tell the
            two ends of an axis apart.
        window_s: over which the gyroscopes are averaged, s.
        root_at_rest: whether hinges between the root and the first units are found too; None: if the model has
            neither a base acceleration nor a free joint.

    Returns:
        The starting calibration with turned mounts and their standard deviations. ``noted`` holds each axis, its
        standard deviation, by how much the mount was turned, undetermined axes, mounts that stay nominal because the
        motion differs from them all by no more than its own uncertainty, and under ``play`` the hinges that also turn
        across their axis: see `oarlock.model.with_play`.

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
    found = {pair: _found(pair, worn, recording, window_s) for pair in pairs}
    units = [name for name in names if any(name in pair.units for pair in pairs)]
    priors = {name: worn.mount_stds_rad[name] for name in units}
    solved = solved_mounts(worn.rotations, priors, [_seen(pair, axis) for pair, axis in found.items()])
    mounts = {name: (mount.link_from_sensor, worn.offsets[name]) for name, mount in solved.items()}
    noted = {
        "how": "hinge axes from motion",
        "joint": {pair.label: _joint_note(pair, axis) for pair, axis in found.items()},
        "sensor": {name: _unit_note(name, mount, found) for name, mount in solved.items()},
        "kept_nominal": [text for pair, axis in found.items() for text in _little_learnt(pair, axis, worn)],
        "stays_nominal": [name for name, mount in solved.items() if not mount.turn_rad.any()],
        "play": _loose(model, [pair for pair, axis in found.items() if _has_play(axis)]),
        "left_out": [name for name in recording.names if name not in names],
    }
    stds = {name: np.sqrt(np.diag(mount.covariance)) for name, mount in solved.items()}
    return worn.calibrated(mounts, noted, mount_stds_rad=stds)


def _found(pair: LinkPair, worn: Worn, recording: Recording, window_s: float) -> dict[str, Any]:
    """The engine's finding."""
    nominal = [worn.rotations[n].T @ axis for n, axis in zip(pair.units, _in_link(pair), strict=True)]
    first, second = worn.read(pair, recording)
    stds = [_prior_std_rad(name, worn) for name in pair.units]
    return _core.find_hinge_axis(first, second, [axis.tolist() for axis in nominal], stds, window_s)


def _prior_std_rad(name: str, worn: Worn) -> float:
    return EXACT_STD_RAD if name == ROOT else float(max(worn.mount_stds_rad[name]))


def _in_link(pair: LinkPair) -> Floats:
    """(2, 3) the axis in the axes of both links."""
    assert pair.axis is not None
    return pair.axis.reshape(2, 3)


def _seen(pair: LinkPair, found: Mapping[str, Any]) -> SeenAxis:
    in_sensor = np.array([found["first"], found["second"]])
    return SeenAxis(
        pair.units, _in_link(pair), in_sensor, np.array(found["information"]), np.array(found["pull"])
    )


def _little_learnt(pair: LinkPair, found: Mapping[str, Any], worn: Worn) -> list[str]:
    ends = zip(pair.units, found["std_rad"], strict=True)
    return [
        f"{name}: axis of {pair.label}"
        for name, std in ends
        if name != ROOT and std > LITTLE_LEARNT * _prior_std_rad(name, worn)
    ]


def _has_play(found: Mapping[str, Any]) -> bool:
    rigid = RIGID_TRANSVERSE * found["transverse_rad_s"] + RIGID_HINGE * found["hinge_rad_s"] + RIGID_RAD_S
    return bool(found["residual_rms_rad_s"] > rigid)


def _loose(model: Model, pairs: Iterable[LinkPair]) -> list[str]:
    """The first hinge of each pair that `with_play` takes: several about one axis turn across it alike."""
    possible = hinges_that_can_have_play(model)
    hinges = ([name for name in pair.joints if name in possible] for pair in pairs)
    return [names[0] for names in hinges if names]


def _unit_note(name: str, mount: LikelyMount, found: Mapping[LinkPair, Mapping[str, Any]]) -> dict[str, Any]:
    ends = [(pair, pair.units.index(name), axis) for pair, axis in found.items() if name in pair.units]
    left = [
        angle_between(mount.link_from_sensor @ axis[("first", "second")[end]], _in_link(pair)[end])
        for pair, end, axis in ends
    ]
    std_rad = float(np.sqrt(np.linalg.eigvalsh(mount.covariance)[-1]))
    return {"turned_rad": float(np.linalg.norm(mount.turn_rad)), "left_rad": left, "std_rad": std_rad}


def _joint_note(pair: LinkPair, found: Mapping[str, Any]) -> dict[str, Any]:
    """Texts, numbers and tables only, so that a file can hold them."""
    return {
        "parent": pair.parent,
        "child": pair.child,
        "axis_in_parent_sensor": found["first"],
        "axis_in_child_sensor": found["second"],
        **{key: found[key] for key in ("std_rad", "residual_rad_s", *TURNING, "sense")},
        "turns_across": _has_play(found),
        "ends_contradict": bool(pair.parent != ROOT and found["sense"] < -CLEAR_SENSE),
    }
