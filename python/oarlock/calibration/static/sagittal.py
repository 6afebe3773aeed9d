"""`calibrate_sagittal`: mounts of any orientation from standing still and ordinary movement, such as walking.

Gravity in the standing posture gives the inclination of a unit. What is missing is its turn about the vertical. People
walk, squat, reach and row mostly in the sagittal plane, so the level axis about which a unit turns most is the body's
lateral axis. Its sign follows from the ranges of the joints: knees and elbows bend to one side only. A unit that turns
about no level axis clearly, such as that of a pelvis in gait, takes the direction of magnetic north that the other
units agree on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from oarlock.calibration.session.body import Body
from oarlock.calibration.session.unit_rows import UnitRows, common
from oarlock.calibration.static.pose_mounts import calibrate_pose, rest_posture
from oarlock.calibration.static.sagittal_signs import flexion_signs, unsure_signs
from oarlock.calibration.static.two_hinges import two_hinges
from oarlock.calibration.static.worn_model import Worn
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import FloatArray
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

LEAST_SHARE = 0.75
"""Share of the level turning that must be about one axis; gait of thighs and shanks has 0.85 to 0.97."""
LEAST_SWING_RAD = 0.3
PLANE_STD_RAD = float(np.radians(8.0))
"""How far the plane of ordinary movement is from the sagittal one."""
NORTH_STD_RAD = float(np.radians(15.0))
"""Of magnetometers that are not calibrated, indoors."""
UNKNOWN_STD_RAD = float(np.pi / np.sqrt(3.0))
"""Of a heading that may be any."""
LEAST_STILL_S = 0.5
PARTS = 8
EITHER_WAY = "movement, either way"


@dataclass(frozen=True, eq=False)
class _Swing:
    """What a unit's gyroscope says of the lateral axis.

    Args:
        time_s: (T,) s.
        angle_rad: (T,) turn about the axis since the still stretch.
        heading_rad: turn of the mount about the vertical that makes the axis lateral; the opposite differs by pi.
        std_rad: of the heading.
        share: share of the level turning that was about the axis.
    """

    time_s: FloatArray
    angle_rad: FloatArray
    heading_rad: float
    std_rad: float
    share: float

    @property
    def clear(self) -> bool:
        """Whether the axis is usable."""
        return self.share >= LEAST_SHARE and float(np.ptp(self.angle_rad)) >= LEAST_SWING_RAD


def calibrate_sagittal(
    model: Model,
    recording: Recording,
    pose: Mapping[str, float] | ArrayLike | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    posture_std_rad: float = np.radians(3.0),
) -> Calibration:
    """Find mounts from a still posture and movement that is mostly in the sagittal plane. No guess of them is needed.

    Args:
        model: its `forward` and `up` define the sagittal plane in the posture; its limits the sides of the joints.
        recording: gyroscope and accelerometer of the units; magnetometers help units that turn about no clear axis.
        pose: as for `calibrate_pose`.
        start_s: where the still stretch begins, s; None finds the first that all units share.
        end_s: where it ends.
        sensors: as for `calibrate_pose`.
        calibration: mounts and lengths to start from; None takes the model's.
        posture_std_rad: how well the posture is taken up, rad.

    Returns:
        The starting calibration with mounts and their standard deviations (3,) rad about the link's axes. ``noted`` has
        for each unit how its heading was found (`movement`, `movement, either way` where the joints allow both
        directions, `two hinges`, `north`, or `nominal`), its standard deviation, and the share of the turning that was
        about one level axis.

    Raises:
        DataError: as `calibrate_pose`; no unit turns about a clear axis.
    """
    names = chosen_units(model, recording, sensors, "sagittal")
    measured = corrected(recording, calibration)
    if start_s is None and end_s is None:
        start_s, end_s = _first_still(measured, names)
    upright = calibrate_pose(
        model,
        recording,
        pose,
        start_s,
        end_s,
        sensors=names,
        calibration=calibration,
        posture_std_rad=posture_std_rad,
    )
    worn = Worn.of(model, upright)
    body, q = Body.of(worn.model, names), rest_posture(worn.model, pose)
    noted_still: Any = upright.noted["still_s"]
    still_s = (float(noted_still[0]), float(noted_still[1]))
    swings = {name: _swing(_unit(measured, name), worn.rotations[name], body, q, still_s) for name in names}
    clear = {name: swing for name, swing in swings.items() if swing.clear}
    if not clear:
        raise DataError(_no_axis_text(swings))
    turns = {n: (s.time_s, s.angle_rad) for n, s in clear.items()}
    signs = flexion_signs(worn.model, body, q, turns)
    unsure = unsure_signs(worn.model, body, q, turns, signs)
    headings = {
        n: (s.heading_rad + (0.0 if signs[n] > 0 else np.pi), UNKNOWN_STD_RAD if n in unsure else s.std_rad)
        for n, s in clear.items()
    }
    norths = {n: _north(_unit(measured, n), worn.rotations[n], body, q, still_s) for n in names}
    how = {name: EITHER_WAY if name in unsure else "movement" for name in names}
    for name in names:
        if name not in clear:
            headings[name], how[name] = _by_north(name, headings, norths)
    mounts = {
        name: (_turned(body, q, name, headings[name][0]) @ worn.rotations[name], worn.offsets[name])
        for name in names
    }
    heading_stds = {name: std_rad for name, (_, std_rad) in headings.items()}
    stds = {name: _stds(body, q, name, posture_std_rad, heading_stds[name]) for name in names}
    streams = {name: _unit(measured, name) for name in names}
    nominal = {name: rotation for name, (rotation, _) in mounts.items()}
    pairs = two_hinges(worn.model, body, q, streams, nominal, still_s, posture_std_rad)
    for name, solved in (m for pair in pairs for m in pair.mounts.items()):
        mounts[name], stds[name] = (solved.link_from_sensor, worn.offsets[name]), solved.std_rad
        up, _, _ = _level(body, q, name)
        heading_stds[name] = float(np.sqrt(up @ solved.covariance @ up))
        how[name] = "two hinges"
    noted = {
        "how": "standing still and sagittal movement",
        "still_s": list(still_s),
        "sensor": {
            name: {
                "heading_by": how[name],
                "heading_std_rad": heading_stds[name],
                "share_about_one_axis": swings[name].share,
            }
            for name in names
        },
        "two_hinges": [pair.noted() for pair in pairs],
    }
    found = worn.calibrated(mounts, noted)
    return replace(found, mount_stds_rad={**found.mount_stds_rad, **stds})


def _first_still(recording: Recording, names: Iterable[str]) -> tuple[float | None, float | None]:
    """The first stretch in which all units are still; none is found by `calibrate_pose`, which says why."""
    stills = common([UnitRows.of(_unit(recording, name)).still(worn=True) for name in names])
    return next(((start, end) for start, end in stills if end - start >= LEAST_STILL_S), (None, None))


def _unit(recording: Recording, name: str) -> ImuStream:
    stream = recording[name]
    assert isinstance(stream, ImuStream)
    return stream


def _level(body: Body, q: FloatArray, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Up, forward and lateral (to the right) of the posture in a link's axes."""
    link_from_root = body.root_from_link(name, q).T
    right = np.cross(body.forward, body.up)
    return link_from_root @ body.up, link_from_root @ body.forward, link_from_root @ right


def _swing(
    stream: ImuStream, link_from_sensor: FloatArray, body: Body, q: FloatArray, still_s: tuple[float, float]
) -> _Swing:
    assert stream.gyro_rad_s is not None
    known = np.isfinite(stream.gyro_rad_s).all(axis=1)
    time_s, gyro = stream.time_s[known], stream.gyro_rad_s[known]
    rest = (time_s >= still_s[0]) & (time_s <= still_s[1])
    rates = (gyro - gyro[rest].mean(axis=0)) @ link_from_sensor.T
    _, forward, right = _level(body, q, stream.name)
    level = np.stack([rates @ right, rates @ forward], axis=1)
    heading, share = _principal(level)
    parts = np.array_split(np.arange(len(level)), PARTS)
    others = [_principal(np.delete(level, part, axis=0))[0] for part in parts]
    off = (np.array(others) - heading + np.pi / 2) % np.pi - np.pi / 2
    jackknife = float(np.sqrt((PARTS - 1) / PARTS * (off**2).sum()))
    about = level @ np.array([np.cos(heading), np.sin(heading)])
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (about[1:] + about[:-1]) * np.diff(time_s))])
    # The axis lies at this angle from lateral to forward; the mount must turn by as much back about the vertical.
    return _Swing(
        time_s, angle - angle[rest].mean(), heading, float(np.hypot(jackknife, PLANE_STD_RAD)), share
    )


def _principal(level: FloatArray) -> tuple[float, float]:
    """Angle of the principal axis from the first column to the second, within a quarter turn, and its share."""
    values, vectors = np.linalg.eigh(level.T @ level)
    x, y = vectors[:, 1]
    heading = float(np.arctan2(y, x))
    wrapped = (heading + np.pi / 2) % np.pi - np.pi / 2
    return wrapped, float(values[1] / max(values.sum(), 1e-12))


def _turned(body: Body, q: FloatArray, name: str, heading_rad: float) -> FloatArray:
    """The turn of a link about the vertical that takes the axis at this angle to the lateral one."""
    up, _, _ = _level(body, q, name)
    # A positive turn about up takes forward to the left: the axis goes from forward to lateral by a negative one.
    return matrix_from_quat(quat_from_rotvec(-heading_rad * up))


def _north(
    stream: ImuStream, link_from_sensor: FloatArray, body: Body, q: FloatArray, still_s: tuple[float, float]
) -> float | None:
    """Angle of magnetic north from lateral to forward in the still stretch, by the mount before its turn."""
    if stream.mag_ut is None:
        return None
    rows = stream.mag_ut[(stream.time_s >= still_s[0]) & (stream.time_s <= still_s[1])]
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        return None
    _, forward, right = _level(body, q, stream.name)
    field = link_from_sensor @ rows.mean(axis=0)
    return float(np.arctan2(field @ forward, field @ right))


def _by_north(
    name: str, headings: Mapping[str, tuple[float, float]], norths: Mapping[str, float | None]
) -> tuple[tuple[float, float], str]:
    """The heading with which a unit's north agrees with that of the units that move; else the nominal one."""
    own = norths[name]
    others = [
        north - headings[n][0]
        for n, north in norths.items()
        if north is not None and n in headings and n != name
    ]
    if own is None or not others:
        return (0.0, UNKNOWN_STD_RAD), "nominal"
    mean = np.exp(1j * np.array(others)).mean()
    spread = float(np.sqrt(-2.0 * np.log(max(abs(mean), 1e-9))))
    return (own - float(np.angle(mean)), float(np.hypot(NORTH_STD_RAD, spread))), "north"


def _stds(body: Body, q: FloatArray, name: str, posture_std_rad: float, heading_std_rad: float) -> FloatArray:
    """(3,) rad about the link's axes: the heading's about the vertical, the posture's about the others."""
    up, _, _ = _level(body, q, name)
    return np.sqrt(posture_std_rad**2 * (1.0 - up**2) + heading_std_rad**2 * up**2)


def _no_axis_text(swings: Mapping[str, _Swing]) -> str:
    texts = [
        f"{name}: turned through {np.degrees(np.ptp(s.angle_rad)):.0f} deg, {100 * s.share:.0f} % about one level axis"
        for name, s in swings.items()
    ]
    return (
        f"sagittal: no unit turns by {np.degrees(LEAST_SWING_RAD):.0f} deg with {100 * LEAST_SHARE:.0f} % about one "
        f"level axis ({'; '.join(texts)}). Walk or squat a few times, or record a session (`oarlock calibrate session`)"
    )
