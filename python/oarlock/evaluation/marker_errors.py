"""`evaluate_markers`: positions of a track compared with optical markers, after alignment of clocks and axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.spatial.transform import Rotation

from oarlock.evaluation.clock import coarse_offset
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.marker_scores import MarkerEvaluation, PointScore
from oarlock.evaluation.markers.attachments import Attachment, attachments_of, check_frames
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.evaluation.resample import resample
from oarlock.model.rotation import matrix_from_quat
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.tracking.track import Track

_FINE_S: Final = 0.03
"""Search range on either side of the coarse offset, which is accurate to 0.01 s."""
_FLAT: Final = 1e-3
"""Smallest ratio of second to first extent of the points.

Below it they lie on a line, and the rotation about this line is undetermined.
"""


def evaluate_markers(
    track: Track,
    markers: Markers,
    frames: Mapping[str, str] | Sequence[Attachment] | None = None,
    *,
    relative_to: str = "root",
    align_clock: bool | str = True,
    align_frame: bool = True,
    start_s: float = 2.0,
    largest_offset_s: float | None = None,
) -> MarkerEvaluation:
    """Score positions of a track against optical markers, as in the published comparison of positions.

    Clocks are aligned first by the correlation of speeds, which do not depend on axes, then by the offset (and drift)
    with the least squared distance. Axes are aligned by one rigid displacement for all points and times. Both are
    fitted to the scored data, so the errors do not include a constant rotation or translation of the whole track.

    Args:
        track: the estimate; its model gives the points.
        markers: positions in m; NaN where not visible. Fill gaps and filter them first if necessary.
        frames: marker -> frame of the model at whose origin the marker sits, or attachments for markers elsewhere on
            their frame. None uses the markers whose names are frame names.
        relative_to: frame of the track in whose axes positions are compared. The measuring system must be fixed in it.
        align_clock: True fits an offset, "drift" also a rate, False uses the time stamps unchanged.
        align_frame: False assumes that the markers are in the axes of `relative_to`.
        start_s: time after the track's first time stamp that is not scored, s.
        largest_offset_s: largest clock offset that is considered, s. A cyclic movement fits at several offsets. Of
            those that fit about equally well the smallest is used, and `notes` reports it.

    Returns:
        RMSE (m) and correlation of each marker, along each axis and in space.

    Source: B. K. P. Horn 1987, "Closed-form solution of absolute orientation using unit quaternions", and W. Kabsch
    1976 (the rotation of least squares, here by singular values).

    Raises:
        DataError: there is no common point or no overlap in time, the points lie on one line, or a frame is unknown.
    """
    used = _pairs(track, markers, frames)
    window = Interval.after(track.time_s, start_s)
    kept = window.of(track.time_s)
    if not kept.any():
        raise DataError(f"evaluate_markers: no sample of the track lies {start_s:g} s after its start")
    time_s = np.asarray(track.time_s[kept])
    own = np.stack([_course(track, a, relative_to)[kept] for a in used], axis=1)
    other = markers.select([a.marker for a in used])
    offset, drift, notes = _clock(time_s, own, other, align_clock, align_frame, largest_offset_s)
    seen = _at(other, time_s, offset, drift)
    _check_common(own, seen, used)
    pose = _rigid(own, seen) if align_frame else np.eye(4)
    placed = seen @ pose[:3, :3].T + pose[:3, 3]
    points = {a.marker: _score(a.frame, own[:, k], placed[:, k]) for k, a in enumerate(used)}
    return MarkerEvaluation(points, offset, drift, pose, relative_to, float(start_s), notes)


def _pairs(
    track: Track, markers: Markers, frames: Mapping[str, str] | Sequence[Attachment] | None
) -> tuple[Attachment, ...]:
    if track.model is None:
        raise DataError(
            "evaluate_markers: this track was loaded without its model; load the model file again"
        )
    if frames is None:
        names = [name for name in markers.names if name in track.model.frame_names]
        if not names:
            raise DataError(
                f"evaluate_markers: no marker ({', '.join(markers.names[:8])}) has the name of a frame of "
                f'"{track.model.name}"; assign frames to markers: frames={{"marker": "frame"}}'
            )
        return attachments_of({name: name for name in names})
    used = attachments_of(frames)
    check_frames(track.model, [a.frame for a in used], "evaluate_markers")
    for a in used:
        markers.index(a.marker)
    return used


def _course(track: Track, attachment: Attachment, relative_to: str) -> Floats:
    """The attached point over time, (T, 3), in the axes of a frame."""
    place = track.frame_positions(attachment.frame, relative_to)
    if not attachment.point_m.any():
        return place
    turned = matrix_from_quat(track.frame_quat_wxyz(attachment.frame, relative_to))
    return np.asarray(place + turned @ attachment.point_m)


def _at(markers: Markers, time_s: Floats, offset_s: float, drift: float) -> Floats:
    """Markers at the track's stamps, (T, n, 3)."""
    origin = float(markers.time_s[0])
    by_track = origin + offset_s + (markers.time_s - origin) * (1.0 + drift)
    columns = markers.position_m.reshape(len(markers), -1).T
    found = np.stack([resample(by_track, column, time_s) for column in columns], axis=1)
    return found.reshape(len(time_s), -1, 3)


def _clock(
    time_s: Floats,
    own: Floats,
    markers: Markers,
    align_clock: bool | str,
    align_frame: bool,
    largest_offset_s: float | None,
) -> tuple[float, float, tuple[str, ...]]:
    """Offset and drift of the markers' clock, and what to say of them."""
    if align_clock is False:
        return 0.0, 0.0, ()
    if align_clock is not True and align_clock != "drift":
        raise DataError(f'evaluate_markers: align_clock is {align_clock!r}; expected True, False or "drift"')
    coarse = coarse_offset(time_s, own, markers.time_s, markers.position_m, largest_offset_s)

    def distance(offset: float, drift: float) -> float:
        seen = _at(markers, time_s, offset, drift)
        both = _both(own, seen)
        if both.sum() < 3:
            return 1e6
        pose = _rigid(own, seen, check=False) if align_frame else np.eye(4)
        away = own[both] - (seen[both] @ pose[:3, :3].T + pose[:3, 3])
        return float(np.mean(np.sum(away**2, axis=1)))

    near = (coarse.offset_s - _FINE_S, coarse.offset_s + _FINE_S)
    fine = minimize_scalar(lambda x: distance(x, 0.0), bounds=near, method="bounded", options={"xatol": 1e-6})
    offset, drift = float(fine.x), 0.0
    if align_clock == "drift":
        offset, drift = _with_drift(distance, offset, float(time_s[-1] - time_s[0]))
    notes = []
    if coarse.rivals_s:
        others = ", ".join(f"{rival:.2f}" for rival in coarse.rivals_s[:3])
        notes.append(f"the movement repeats: offsets of {others} s fit about as well as {offset:.2f} s")
    if coarse.correlation < 0.5:
        notes.append(
            f"the correlation of the speeds of track and markers is only {coarse.correlation:.2f}; "
            "check that both are from the same trial"
        )
    return offset, drift, tuple(notes)


def _with_drift(distance: object, offset: float, span_s: float) -> tuple[float, float]:
    """Both numbers scaled to seconds at the end of the recording, so that one step suits both."""
    assert callable(distance)
    simplex = np.array([[0.0, 0.0], [2e-3, 0.0], [0.0, 2e-3]])
    found = minimize(
        lambda x: distance(offset + x[0], x[1] / span_s),
        np.zeros(2),
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-6, "fatol": 1e-14, "maxiter": 200},
    )
    return offset + float(found.x[0]), float(found.x[1]) / span_s


def _both(own: Floats, seen: Floats) -> Bools:
    return np.asarray(np.isfinite(own).all(axis=2) & np.isfinite(seen).all(axis=2))


def _check_common(own: Floats, seen: Floats, used: Sequence[Attachment]) -> None:
    both = _both(own, seen)
    for k, a in enumerate(used):
        if both[:, k].sum() < 2:
            raise DataError(
                f'evaluate_markers: marker "{a.marker}" and frame "{a.frame}" share {int(both[:, k].sum())} samples: '
                "the marker is not seen, or the clocks do not overlap. Leave it out, or align the clocks."
            )


def _rigid(own: Floats, seen: Floats, check: bool = True) -> Floats:
    """The rigid displacement (4, 4) that fits the markers to the track's points in least squares."""
    both = _both(own, seen)
    a, b = own[both], seen[both]
    a0, b0 = a.mean(axis=0), b.mean(axis=0)
    extent = np.linalg.svd((b - b0) / np.sqrt(len(b)), compute_uv=False)
    if check and not extent[1] > _FLAT * extent[0]:
        raise DataError(
            f"evaluate_markers: the markers stay on a line ({1e3 * extent[0]:.0f} mm long, {1e3 * extent[1]:.2f} mm "
            "across), so axes cannot be aligned. Use more markers, or turn them yourself and give align_frame=False."
        )
    pose = np.eye(4)
    pose[:3, :3] = Rotation.align_vectors(a - a0, b - b0)[0].as_matrix()
    pose[:3, 3] = a0 - pose[:3, :3] @ b0
    return pose


def _score(frame: str, own: Floats, seen: Floats) -> PointScore:
    both = np.isfinite(own).all(axis=1) & np.isfinite(seen).all(axis=1)
    a, b = own[both], seen[both]
    error = a - b
    axes = np.sqrt(np.mean(error**2, axis=0))
    centred_a, centred_b = a - a.mean(axis=0), b - b.mean(axis=0)
    along = np.array([_correlation(centred_a[:, k], centred_b[:, k]) for k in range(3)])
    return PointScore(
        frame=frame,
        samples=int(both.sum()),
        rmse_m=axes,
        rmse_3d_m=float(np.linalg.norm(axes)),
        correlation=along,
        correlation_3d=_correlation(centred_a.ravel(), centred_b.ravel()),
        mean_error_m=np.asarray(error.mean(axis=0)),
    )


def _correlation(a: Floats, b: Floats) -> float:
    """Correlation of two signals; NaN if either is constant to a hundredth of a millimetre."""
    lengths = np.linalg.norm(a), np.linalg.norm(b)
    if min(lengths) < 1e-5 * np.sqrt(len(a)):
        return float("nan")
    return float(a @ b / (lengths[0] * lengths[1]))
