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

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.unit_rows import WINDOW_S, UnitRows, common, joined
from oarlock.calibration.static.pose_mounts import Span, calibrate_pose, rest_posture
from oarlock.calibration.static.sagittal_signs import facing
from oarlock.calibration.static.two_hinges import two_hinges
from oarlock.calibration.static.worn_model import Worn
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Bools, Floats
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
SWAY_RAD_S = 0.05
"""Mean rate over a quarter of a second that a person who stands still reaches by sway (Winter 1995: 1 to 3 deg/s)."""
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

    time_s: Floats
    angle_rad: Floats
    heading_rad: float
    std_rad: float
    share: float

    @property
    def clear(self) -> bool:
        """Whether the axis is usable."""
        return self.share >= LEAST_SHARE and float(np.ptp(self.angle_rad)) >= LEAST_SWING_RAD


@dataclass(frozen=True)
class _Heading:
    """The turn about the vertical that a mount lacks, its standard deviation, and how it was found."""

    angle_rad: float
    std_rad: float
    by: str


@dataclass(frozen=True, eq=False)
class _Standing:
    """The units of a body in its still posture.

    Args:
        body: links of the units.
        q: (n,) the posture.
        units: corrected streams.
        rotations: unit -> (3, 3), link from sensor, right but for a turn about the vertical.
        still_s: the stretch in the posture.
    """

    body: BodyKinematics
    q: Floats
    units: Mapping[str, ImuStream]
    rotations: Mapping[str, Floats]
    still_s: tuple[float, float]

    def level(self, name: str) -> tuple[Floats, Floats, Floats]:
        """Up, forward and lateral (to the right) of the posture in a link's axes."""
        link_from_root = self.body.root_from_link(name, self.q).T
        right = np.cross(self.body.forward, self.body.up)
        return link_from_root @ self.body.up, link_from_root @ self.body.forward, link_from_root @ right

    def rests(self, time_s: Floats) -> Bools:
        """(T,) whether the stamps are in the still stretch."""
        return np.asarray((time_s >= self.still_s[0]) & (time_s <= self.still_s[1]))

    def swing(self, name: str) -> _Swing:
        """The level axis about which a unit turns most."""
        stream = self.units[name]
        assert stream.gyro_rad_s is not None
        known = np.isfinite(stream.gyro_rad_s).all(axis=1)
        time_s, gyro = stream.time_s[known], stream.gyro_rad_s[known]
        rest = self.rests(time_s)
        rates = (gyro - gyro[rest].mean(axis=0)) @ self.rotations[name].T
        _, forward, right = self.level(name)
        level = np.stack([rates @ right, rates @ forward], axis=1)
        heading, share = _principal(level)
        parts = np.array_split(np.arange(len(level)), PARTS)
        others = [_principal(np.delete(level, part, axis=0))[0] for part in parts]
        off = (np.array(others) - heading + np.pi / 2) % np.pi - np.pi / 2
        jackknife = float(np.sqrt((PARTS - 1) / PARTS * (off**2).sum()))
        about = level @ np.array([np.cos(heading), np.sin(heading)])
        angle = np.concatenate([[0.0], np.cumsum(0.5 * (about[1:] + about[:-1]) * np.diff(time_s))])
        std_rad = float(np.hypot(jackknife, PLANE_STD_RAD))
        return _Swing(time_s, angle - angle[rest].mean(), heading, std_rad, share)

    def turned(self, name: str, heading_rad: float) -> Floats:
        """The mount (3, 3) of a unit, turned about the vertical: the axis at this angle becomes the lateral one."""
        up, _, _ = self.level(name)
        # A positive turn about up takes forward to the left, so forward goes to lateral by a negative one.
        return np.asarray(matrix_from_quat(quat_from_rotvec(-heading_rad * up)) @ self.rotations[name])

    def north_rad(self, name: str) -> float | None:
        """Angle of magnetic north from lateral to forward in the still stretch, by the mount before its turn."""
        stream = self.units[name]
        if stream.mag_ut is None:
            return None
        rows = stream.mag_ut[self.rests(stream.time_s)]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if not len(rows):
            return None
        _, forward, right = self.level(name)
        field = self.rotations[name] @ rows.mean(axis=0)
        return float(np.arctan2(field @ forward, field @ right))

    def stds_rad(self, name: str, posture_std_rad: float, heading_std_rad: float) -> Floats:
        """(3,) about the link's axes: the heading's about the vertical, the posture's about the others."""
        up, _, _ = self.level(name)
        return np.sqrt(posture_std_rad**2 * (1.0 - up**2) + heading_std_rad**2 * up**2)


def calibrate_sagittal(
    model: Model,
    recording: Recording,
    rest_q: Mapping[str, float] | ArrayLike | None = None,
    still_s: Span | None = None,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    posture_std_rad: float = np.radians(3.0),
) -> Calibration:
    """Find mounts from a still posture and movement that is mostly in the sagittal plane. No guess of them is needed.

    Args:
        model: its `forward` and `up` define the sagittal plane in the posture; its limits the sides of the joints.
        recording: gyroscope and accelerometer of the units; magnetometers help units that turn about no clear axis.
        rest_q: the posture, as for `calibrate_pose`. None is the model's rest posture.
        still_s: start and end of the still stretch, s. None finds the first that all units share.
        sensors: as for `calibrate_pose`.
        calibration: mounts and lengths to start from; None takes the model's.
        posture_std_rad: how well the posture is taken up, rad.

    Returns:
        The starting calibration with mounts and their standard deviations (3,) rad about the link's axes. ``noted`` has
        for each unit how its heading was found (`movement`, `movement, either way` where the joints allow both
        directions, `two hinges`, `north`, or `nominal`), its standard deviation, and the share of the turning that was
        about one level axis. Its `balls` are pairs of hinges whose axes stay unknown: track them as one ball
        (`with_ball_joint`, or `oarlock track --ball`).

    Raises:
        DataError: as `calibrate_pose`; no unit turns about a clear axis.
    """
    names = chosen_units(model, recording, sensors, "sagittal")
    measured = corrected(recording, calibration)
    still_s = still_s or _first_still(measured, names)
    upright = calibrate_pose(
        model,
        recording,
        rest_q,
        still_s,
        sensors=names,
        calibration=calibration,
        posture_std_rad=posture_std_rad,
    )
    worn = Worn.of(model, upright)
    body, q = BodyKinematics.of(worn.model, names), rest_posture(worn.model, rest_q)
    noted_still: Any = upright.noted["still_s"]
    still_s = (float(noted_still[0]), float(noted_still[1]))
    standing = _Standing(body, q, {name: _unit(measured, name) for name in names}, worn.rotations, still_s)
    swings = {name: standing.swing(name) for name in names}
    headings = _headings(standing, swings)
    mounts = {name: standing.turned(name, headings[name].angle_rad) for name in names}
    pairs = two_hinges(worn.model, body, q, standing.units, mounts, still_s, posture_std_rad)
    stds = {name: standing.stds_rad(name, posture_std_rad, headings[name].std_rad) for name in names}
    for name, solved in (m for pair in pairs for m in pair.mounts.items()):
        mounts[name], stds[name] = solved.link_from_sensor, solved.std_rad
        up, _, _ = standing.level(name)
        headings[name] = _Heading(0.0, float(np.sqrt(up @ solved.covariance @ up)), "two hinges")
    noted = {
        "how": "standing still and sagittal movement",
        "still_s": list(still_s),
        "sensor": {
            name: {
                "heading_by": headings[name].by,
                "heading_std_rad": headings[name].std_rad,
                "share_about_one_axis": swings[name].share,
            }
            for name in names
        },
        "two_hinges": [pair.noted() for pair in pairs],
        "balls": [list(p.joints) for p in pairs if p.is_ball({n: headings[n].std_rad for n in names})],
    }
    found = worn.calibrated({name: (mounts[name], worn.offsets[name]) for name in names}, noted)
    return replace(found, mount_stds_rad={**found.mount_stds_rad, **stds})


def _headings(standing: _Standing, swings: Mapping[str, _Swing]) -> dict[str, _Heading]:
    """The turn of each unit about the vertical, from its own movement or from north.

    Raises:
        DataError: no unit turns about a clear axis.
    """
    clear = {name: swing for name, swing in swings.items() if swing.clear}
    if not clear:
        raise DataError(_no_axis_text(swings))
    turns = {name: (swing.time_s, swing.angle_rad) for name, swing in clear.items()}
    signs, unsure = facing(standing.body, standing.q, turns)
    found = {}
    for name, swing in clear.items():
        angle_rad = swing.heading_rad + (0.0 if signs[name] > 0 else np.pi)
        std_rad, by = (UNKNOWN_STD_RAD, EITHER_WAY) if name in unsure else (swing.std_rad, "movement")
        found[name] = _Heading(angle_rad, std_rad, by)
    norths = {name: standing.north_rad(name) for name in swings}
    for name in swings:
        if name not in clear:
            found[name] = _by_north(name, found, norths)
    return found


def _first_still(recording: Recording, names: Iterable[str]) -> Span | None:
    """The first stretch in which all units are still; without one `calibrate_pose` says why."""
    units = [UnitRows.of(_unit(recording, name)) for name in names]
    stills = common(
        [[part for span in unit.still(worn=True) for part in _settled(unit, span)] for unit in units]
    )
    return next(((start, end) for start, end in stills if end - start >= LEAST_STILL_S), None)


def _settled(unit: UnitRows, span_s: Span) -> list[Span]:
    """Parts of a still stretch without its slow turns, which scatter as little as rest but would bias the gyroscope."""
    rows = unit.rows(span_s)
    time_s, gyro = unit.time_s[rows], unit.gyro[rows]
    block = ((time_s - time_s[0]) / WINDOW_S).astype(int)
    means = np.stack([np.bincount(block, gyro[:, k]) / np.bincount(block) for k in range(3)], axis=1)
    settled = np.linalg.norm(means - np.median(means, axis=0), axis=1) <= SWAY_RAD_S
    starts_s = time_s[0] + WINDOW_S * np.arange(len(means) + 1)
    return joined([(starts_s[k], min(starts_s[k + 1], span_s[1])) for k in np.flatnonzero(settled)])


def _unit(recording: Recording, name: str) -> ImuStream:
    stream = recording[name]
    assert isinstance(stream, ImuStream)
    return stream


def _principal(level: Floats) -> tuple[float, float]:
    """Angle of the principal axis from the first column to the second, within a quarter turn, and its share."""
    values, vectors = np.linalg.eigh(level.T @ level)
    x, y = vectors[:, 1]
    heading = float(np.arctan2(y, x))
    wrapped = (heading + np.pi / 2) % np.pi - np.pi / 2
    return wrapped, float(values[1] / max(values.sum(), 1e-12))


def _by_north(name: str, headings: Mapping[str, _Heading], norths: Mapping[str, float | None]) -> _Heading:
    """The heading with which a unit's north agrees with that of the units that move; else the nominal one."""
    own = norths[name]
    others = [
        north - headings[n].angle_rad
        for n, north in norths.items()
        if north is not None and n in headings and n != name
    ]
    if own is None or not others:
        return _Heading(0.0, UNKNOWN_STD_RAD, "nominal")
    mean = np.exp(1j * np.array(others)).mean()
    spread = float(np.sqrt(-2.0 * np.log(max(abs(mean), 1e-9))))
    return _Heading(own - float(np.angle(mean)), float(np.hypot(NORTH_STD_RAD, spread)), "north")


def _no_axis_text(swings: Mapping[str, _Swing]) -> str:
    texts = [
        f"{name}: turned through {np.degrees(np.ptp(s.angle_rad)):.0f} deg, {100 * s.share:.0f} % about one level axis"
        for name, s in swings.items()
    ]
    return (
        f"sagittal: no unit turns by {np.degrees(LEAST_SWING_RAD):.0f} deg with {100 * LEAST_SHARE:.0f} % about one "
        f"level axis ({'; '.join(texts)}). Walk or squat a few times, or record a session (`oarlock calibrate session`)"
    )
