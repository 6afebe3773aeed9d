"""`evaluate_orientations`: hinge angles compared with orientations from another system for the same sensors.

Every unit of such a system has its own north, so only its rotation since a stationary interval, in its own axes, is
used. The mount transforms it to the link; the hinge angle is the twist of a link relative to the one before.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.joints import joint_scores
from oarlock.evaluation.scores import Evaluation
from oarlock.model.chain_geometry import HingeLink, hinge_links, posture
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Bools, Floats, Indices
from oarlock.storage.errors import DataError
from oarlock.tracking.track import Track, track_without_filter

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.recording import Recording

Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class OrientationReference:
    """Hinge angles from orientations.

    Args:
        track: the angles, rad, as a track without uncertainty; NaN where an orientation is missing, and for joints
            that the chain does not have.
        off_hinge_rad: per joint (T,), the part of the neighbours' rotation that is not about the hinge: the angle that
            remains after the twist about the hinge is removed.
        off_hinge_plain_rad: the same for the rotation from one unit to the next as in the file, with each unit's own
            heading. The first joint has none, because no unit precedes it.
    """

    track: Track
    off_hinge_rad: Mapping[str, Floats]
    off_hinge_plain_rad: Mapping[str, Floats]


def evaluate_orientations(
    track: Track,
    recording: Recording,
    orientations: Mapping[str, Floats],
    calibration: Calibration,
    start_s: float = 2.0,
    end_s: float | None = None,
    *,
    still_s: Span | None = None,
    reference: str = "the orientations",
) -> Evaluation:
    """Score a track's hinge angles against orientations of the same sensors.

    The reference angle of a joint is the twist of its link relative to the previous link about their hinge, since the
    stationary interval (see the module's docstring). In a chain of parallel hinges this is the sensor's own twist since
    rest minus that of its neighbour. The reference has errors of its own: coverage and NEES show the disagreement of
    the two, not which of them is wrong.

    Args:
        track: the estimate.
        recording: has the time stamps of the orientations; the streams of the chain share them.
        orientations: sensor name -> (T, 4) quat_wxyz, earth_from_sensor, one row per row of its stream; NaN is missing.
        calibration: mounts of the sensors; ``noted`` has the stationary interval and its posture.
        start_s: time after the track's first time stamp that is not scored, s.
        end_s: end of the scored part, s after the track's first time stamp; None scores to the end.
        still_s: the stationary interval (start, end), s, if the calibration does not contain it.
        reference: name of the orientations in tables and reports.

    Returns:
        Evaluation of the joints, and NIS of the sensors. A joint's note gives the part of the reference's rotation
        between neighbours that is not about the hinge (RMS): since rest, and as in the file with each unit's own
        heading.

    Raises:
        DataError: no sensor has both mount and orientation, the rows do not match the time stamps, the stationary
            interval is unknown, or the track has no sample in the window.
    """
    if track.model is None:
        raise DataError(
            "evaluate_orientations: this track was loaded without its model; load the model file again"
        )
    angles = angles_from_orientations(track.model, recording, orientations, calibration, still_s=still_s)
    window = Interval.after(track.time_s, start_s)
    if end_s is not None:
        window = replace(window, end_s=min(window.end_s, float(track.time_s[0]) + end_s))
    if not window.of(track.time_s).any():
        raise DataError(
            f"evaluate_orientations: the track has no sample from {window.start_s:.3f} to {window.end_s:.3f} s"
        )
    kept = window.of(angles.track.time_s)
    joints = tuple(
        replace(score, note=_note(angles, score.name, kept)) if score.observed else score
        for score in joint_scores(track, angles.track, window)
    )
    return Evaluation(
        joints=joints,
        positions=(),
        states=None,
        sensors=sensor_scores(track, window),
        start_s=float(start_s),
        samples=int(np.count_nonzero(window.of(track.time_s))),
        reference=reference,
    )


def angles_from_orientations(
    model: Model,
    recording: Recording,
    orientations: Mapping[str, Floats],
    calibration: Calibration,
    *,
    still_s: Span | None = None,
) -> OrientationReference:
    """Hinge angles of a chain from its sensors' orientations; arguments and errors as `evaluate_orientations`."""
    names = [n for n in calibration.mounts if n in orientations and n in recording]
    if not names:
        raise DataError(
            f"orientations: none of {_list(orientations)} has a mount in the calibration ({_list(calibration.mounts)}) "
            f"and a stream in the recording ({_list(recording.names)})"
        )
    rest_q = posture(model, calibration.noted.get("rest_q"))  # type: ignore[arg-type]
    links = hinge_links(model, names, rest_q)
    time_s = _shared_stamps(recording, [link.sensor for link in links])
    still = _still_rows(time_s, still_s if still_s is not None else calibration.noted.get("still_s"))
    units = [_earth_from_sensor(orientations, link.sensor, time_s) for link in links]
    turned = [
        _world_from_link(link, *unit, calibration.mounts[link.sensor][0], still)
        for link, unit in zip(links, units, strict=True)
    ]
    q = np.full((len(time_s), len(model.coordinate_names)), np.nan)
    off, plain = {}, {}
    good = np.ones(len(time_s), dtype=bool)
    for i, link in enumerate(links):
        good = good & units[i][1]
        before = turned[i - 1] if i else Rotation.identity(len(time_s))
        twist, off[link.joint] = _twist(before.inv() * turned[i], link, still, good)
        column = list(model.coordinate_names).index(link.joint)
        q[:, column] = rest_q[column] + twist
        if i:
            # earth_from_link, with each unit's own north
            parent, child = (
                units[k][0] * Rotation.from_matrix(calibration.mounts[links[k].sensor][0]).inv()
                for k in (i - 1, i)
            )
            plain[link.joint] = _off_plain(parent.inv() * child, links[i - 1], link, good)
    provenance = {"model": model.name, "reference": "orientations"}
    return OrientationReference(track_without_filter(model, time_s, q, provenance=provenance), off, plain)


def _shared_stamps(recording: Recording, names: Sequence[str]) -> Floats:
    first = recording[names[0]].time_s
    for name in names[1:]:
        if not np.array_equal(recording[name].time_s, first):
            raise DataError(
                f'orientations: the streams "{names[0]}" and "{name}" do not share their stamps; angles between '
                "units need both at the same time. Bring the orientations onto one clock first."
            )
    return first


def _still_rows(time_s: Floats, still_s: object) -> Indices:
    if not isinstance(still_s, list | tuple) or len(still_s) != 2:
        raise DataError(
            "orientations: the calibration does not contain the stationary interval from which rotations are counted; "
            "give still_s=(start, end) in s"
        )
    rows = np.flatnonzero((time_s >= still_s[0]) & (time_s <= still_s[1]))
    if not rows.size:
        raise DataError(
            f"orientations: no row lies in the stationary interval {still_s[0]:.3f} to {still_s[1]:.3f} s; the stamps "
            f"span {time_s[0]:.3f} to {time_s[-1]:.3f} s"
        )
    return rows


def _earth_from_sensor(
    orientations: Mapping[str, Floats], name: str, time_s: Floats
) -> tuple[Rotation, Bools]:
    """Rotations (T), the identity where one is missing, and a mask of those present."""
    quat_wxyz = real_array(orientations[name], (None, 4), f'orientations of "{name}"')
    if len(quat_wxyz) != len(time_s):
        raise DataError(f'orientations of "{name}": {len(quat_wxyz)} rows, but its stream has {len(time_s)}')
    norms = np.linalg.norm(quat_wxyz, axis=1)
    there = np.isfinite(norms)
    if not there.any() or np.abs(norms[there] - 1.0).max() > 0.01:
        worst = norms[there][np.argmax(np.abs(norms[there] - 1.0))] if there.any() else np.nan
        raise DataError(
            f'orientations of "{name}": a quaternion of norm {worst:.4f}; expected unit quaternions, w first'
        )
    filled = np.where(there[:, None], quat_wxyz, (1.0, 0.0, 0.0, 0.0))
    return Rotation.from_quat(filled[:, [1, 2, 3, 0]]), there


def _world_from_link(
    link: HingeLink, unit: Rotation, there: Bools, link_from_sensor: Floats, still: Indices
) -> Rotation:
    """Orientation of the link, (T): its posture at rest, rotated by the sensor's rotation since then."""
    resting = still[there[still]]
    if not resting.size:
        raise DataError(f'orientations of "{link.sensor}": all are missing in the stationary interval')
    mount = Rotation.from_matrix(link_from_sensor)
    since_rest = unit[resting].mean().inv() * unit
    return Rotation.from_matrix(link.world_from_link) * mount * since_rest * mount.inv()


def _twist(between: Rotation, link: HingeLink, still: Indices, good: Bools) -> tuple[Floats, Floats]:
    """Twist about the link's hinge since rest, rad, continuous; and the angle of the rest of the rotation."""
    resting = between[still[good[still]]].mean()
    along, across = _parts(resting.inv() * between, link)
    twist, off = np.full(len(along), np.nan), np.full(len(along), np.nan)
    twist[good] = np.unwrap(along[good])
    twist -= 2 * np.pi * np.round(np.nanmean(twist[still]) / (2 * np.pi))
    off[good] = across[good]
    return twist, off


def _off_plain(between: Rotation, before: HingeLink, link: HingeLink, good: Bools) -> Floats:
    """The part of the rotation between neighbours that is not about their hinge, rad."""
    at_rest = Rotation.from_matrix(before.world_from_link.T @ link.world_from_link)
    across = _parts(at_rest.inv() * between, link)[1]
    return np.where(good, across, np.nan)


def _parts(turn: Rotation, link: HingeLink) -> tuple[Floats, Floats]:
    """Swing and twist (Dobrowolski 2015): the angle about the hinge and the angle of the remaining rotation, rad."""
    quat_xyzw = turn.as_quat()
    along = quat_xyzw[:, :3] @ link.axis_in_link
    w = quat_xyzw[:, 3]
    twist = 2 * np.arctan2(along, w)
    return twist, 2 * np.arccos(np.clip(np.hypot(along, w), 0.0, 1.0))


def _note(reference: OrientationReference, joint: str, kept: Bools) -> str:
    if joint not in reference.off_hinge_rad:
        return ""
    since = f"{_rms_deg(reference.off_hinge_rad[joint][kept]):.1f} deg off the hinge"
    if joint not in reference.off_hinge_plain_rad:
        return since
    return f"{since}, plain {_rms_deg(reference.off_hinge_plain_rad[joint][kept]):.1f}"


def _rms_deg(angle_rad: Floats) -> float:
    return float(np.degrees(np.sqrt(np.nanmean(angle_rad**2))))


def _list(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
