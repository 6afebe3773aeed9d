"""`calibrate_pose`: inclination of mounts from gravity in a still, known posture.

The search itself is the engine's (`calibrate::pose_mounts`); docs/mounts.md explains it and shows an example.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from oarlock import _core
from oarlock.calibration.static.worn_model import Worn
from oarlock.model.chain_geometry import posture
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units, readings
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

Span = tuple[float, float]
SEARCH = "pose"


def calibrate_pose(
    model: Model,
    recording: Recording,
    rest_q: Mapping[str, float] | ArrayLike | None = None,
    still_s: Span | None = None,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    posture_std_rad: float = np.radians(3.0),
) -> Calibration:
    """Turn mounts so that a still posture agrees with gravity.

    While the body stands still, each accelerometer shows how its unit is inclined. A mount is turned by the least
    angle that makes up agree; its heading, the turn about the vertical, stays nominal.

    Args:
        model: its poses give each link's axes in the posture.
        recording: gyroscope and accelerometer of the units.
        rest_q: the posture, by coordinate (the others as at rest) or (n_coordinates,), rad and m. None is the
            model's rest posture.
        still_s: start and end of the still stretch, s. None finds the longest that all units share.
        sensors: the units to use; None takes all of the model that were recorded.
        calibration: mounts and lengths to start from; None takes the model's.
        posture_std_rad: how well the posture is taken up, rad.

    Returns:
        The starting calibration with turned mounts. ``noted`` holds by how much each was turned, its standard
        deviation, the gyroscope's bias and the norm of gravity as the unit saw it.

    Raises:
        DataError: no still stretch, a named one in which a unit moves, a posture of another shape, a stream without
            gyroscope or accelerometer; with sensor and figures.
    """
    names = chosen_units(model, recording, sensors, SEARCH)
    recording = corrected(recording, calibration)
    require_plausible(recording.only(names))
    _check_span(still_s)
    worn = Worn.of(model, calibration)
    q = rest_posture(worn.model, rest_q)
    described = worn.model.describe()
    frames = {s.name: worn.model.frame_names.index(s.frame) for s in described.inertial_units}
    poses = worn.model.forward_kinematics(q)
    units = [
        readings(recording[name])
        | {
            "link_from_sensor": worn.rotations[name].tolist(),
            "world_from_link": poses[frames[name], :3, :3].tolist(),
        }
        for name in names
    ]
    found = _core.find_pose_mounts(units, described.world.up, still_s, float(posture_std_rad))
    mounts = {m["name"]: (np.array(m["link_from_sensor"]), worn.offsets[m["name"]]) for m in found}
    noted = {
        "how": "a still posture",
        "still_s": found[0]["still_s"],
        "pose": dict(zip(model.coordinate_names, q.tolist(), strict=True)),
        "sensor": {m["name"]: _figures(m) for m in found},
        "left_out": [name for name in recording.names if name not in names],
    }
    return worn.calibrated(mounts, noted)


def rest_posture(model: Model, pose: Mapping[str, float] | ArrayLike | None) -> Floats:
    """Coordinates (n_coordinates,) in rad or m: those given, and the model's rest posture for the others.

    Raises:
        DataError: as `oarlock.model.chain_geometry.posture`.
    """
    rest = np.concatenate([np.ravel(j.rest) for j in model.describe().joints] or [np.zeros(0)])
    if pose is None:
        return posture(model, rest)
    if not isinstance(pose, Mapping):
        return posture(model, pose)
    posture(model, pose)
    at_rest = dict(zip(model.coordinate_names, rest.tolist(), strict=True))
    return posture(model, at_rest | dict(pose))


def _check_span(still_s: Span | None) -> None:
    if still_s is not None and not still_s[0] < still_s[1]:
        raise DataError(
            f"{SEARCH}: the still stretch from {still_s[0]} to {still_s[1]} s; expected a start and a later end in s"
        )


def _figures(mount: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in mount.items() if k not in ("name", "link_from_sensor", "still_s")}
