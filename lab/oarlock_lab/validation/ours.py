"""Everything that Oarlock is asked to do here: one function a data set, with the shipped model of its name.

Each gives the live track and the smoothed one, with the bodies named as in the reference. The models' root has z
up. Where a model or a mode is not there, a function raises `NotRunError`, and the tables show the reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import cast

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import Calibration, Config, Recording, Track
from oarlock.formats.datasets.broad import BODY
from oarlock.formats.datasets.dfjimu import BODIES
from oarlock.formats.datasets.diodem import SEGMENTS
from oarlock.formats.datasets.openaxes import LINKS

from .estimate import NotRunError, OrientationEstimate

NAMES = ("Oarlock", "Oarlock, smoothed")
CALIBRATED = "calibration found"
CALIBRATED_NAMES = tuple(f"{name}, {CALIBRATED}" for name in NAMES)
"""The same with a calibration that was found from the recording itself."""

SKIN_NAMES = tuple(f"{name}, skin" for name in NAMES)
"""The same with units that turn on their links."""

FOAM = {"links": {"skin_std_rad": 0.09, "skin_time_s": 30}}
"""Turn of a unit on foam about each axis, 5 deg: readers of the data give 5 to 12 deg, mean and movement together."""

WINDOW_S: Mapping[str, float] = {"rigid": 0.2, "foam": 0.4}
"""Over which joints are sought, as docs/mounts.md advises for each kind of mounting."""

SCREWED_ON_STD_M = 0.01
"""As of `dfjimu`'s model file. A fit knows its lever to a millimetre, and a joint is no point."""

ARM = ("upper_arm", "forearm")

WITH_LENGTHS = Config(estimate=("gyro_bias", "accel_bias", "lengths"))
"""Lever arms are known to a centimetre, or not at all: they are states with the model file's standard deviations."""


def track_dfjimu(recording: Recording, config: Config | None = None) -> Iterator[OrientationEstimate]:
    """Root attitude and a ball joint: the bodies' frames lie in the joint and have the axes of their units."""
    return (estimate for estimate, _ in dfjimu_tracks(recording, config))


def dfjimu_tracks(
    recording: Recording, config: Config | None = None
) -> Iterator[tuple[OrientationEstimate, Track]]:
    """The same with the tracks, which hold the joint and its bands."""
    joint = cast(Mapping[str, list[float]], recording.meta["joint_in_sensor_m"])
    sensors = zip(("r1", "r2"), BODIES, strict=True)
    levers = {f"{r}_{a}": -x for r, body in sensors for a, x in zip("xyz", joint[body], strict=True)}
    settings = WITH_LENGTHS if config is None else config
    return _both("dfjimu", recording, BODIES, Calibration(parameters=levers), settings)


def track_diodem(recording: Recording) -> Iterator[OrientationEstimate]:
    """Free root, ball joint, three hinges; the frames are the segments, the units' axes nominally theirs."""
    return (estimate for estimate, _ in diodem_tracks(recording))


def diodem_tracks(recording: Recording) -> Iterator[tuple[OrientationEstimate, Track]]:
    """The same with the tracks, which hold the joints and their bands."""
    return _both("diodem_arm", recording, SEGMENTS, config=WITH_LENGTHS)


def track_diodem_skin(recording: Recording) -> Iterator[OrientationEstimate]:
    """The same for units on foam, which turn on their links."""
    model = oarlock.load_model("diodem_arm").with_tables(FOAM)
    for name, estimate in zip(
        SKIN_NAMES, _tracked(model, recording, SEGMENTS, config=WITH_LENGTHS), strict=True
    ):
        yield replace(estimate, name=name)


def track_openaxes(
    recording: Recording, calibration: Calibration | None = None
) -> Iterator[OrientationEstimate]:
    """Two neighbouring links of the robot; the model holds how the units sit on them."""
    return _tracked("openaxes_ur5", recording, LINKS, calibration)


def track_dfjimu_calibrated(recording: Recording) -> Iterator[OrientationEstimate]:
    """Lever arms from `calibrate_joint_centers`; those of the files are not looked at."""
    model = oarlock.load_model("dfjimu")
    centers = oarlock.calibration.calibrate_joint_centers(model, _with_nominal(recording, model))
    return _named_calibrated(_tracked("dfjimu", recording, BODIES, centers, WITH_LENGTHS))


def track_diodem_calibrated(recording: Recording, mounted: str) -> Iterator[OrientationEstimate]:
    """Places and lengths from `calibrate_joint_centers`; mounts stay nominal.

    What is screwed on stays where it was found, to a centimetre; on foam it moves, as the model file has it.
    """
    model = oarlock.load_model("diodem_arm")
    with_nominal = _with_nominal(recording, model)
    centers = oarlock.calibration.calibrate_joint_centers(model, with_nominal, window_s=WINDOW_S[mounted])
    if mounted == "rigid":
        centers = replace(centers, parameter_stds=dict.fromkeys(centers.parameters, SCREWED_ON_STD_M))
    return _named_calibrated(_tracked(model, recording, SEGMENTS, centers, WITH_LENGTHS))


def track_openaxes_calibrated(recording: Recording) -> Iterator[OrientationEstimate]:
    """The hinge's axis turns the nominal mounts, then units are placed."""
    model = oarlock.load_model("openaxes_ur5")
    with_nominal = _with_nominal(recording, model)
    axes = oarlock.calibration.calibrate_hinge_axes(model, with_nominal)
    centers = oarlock.calibration.calibrate_joint_centers(model, with_nominal, calibration=axes)
    return _named_calibrated(_tracked("openaxes_ur5", recording, LINKS, centers))


def _named_calibrated(estimates: Iterator[OrientationEstimate]) -> Iterator[OrientationEstimate]:
    return (replace(estimate, name=f"{estimate.name}, {CALIBRATED}") for estimate in estimates)


def track_broad(recording: Recording) -> Iterator[OrientationEstimate]:
    """A single free body."""
    return _tracked("broad", recording, (BODY,))


def qmt_tracks(
    recording: Recording, segments: Iterable[str], still_s: tuple[float, float]
) -> Iterator[tuple[OrientationEstimate, Track]]:
    """The upper body of the person; these segments are scored, in their units' axes. With the tracks.

    The mounts come from `still_s`, in which the person stands in the model's rest posture.
    """
    name = "qmt_full_body"
    model = oarlock.load_model(name)
    calibration = oarlock.calibration.calibrate_pose(model, _with_nominal(recording, model), None, still_s)
    mounts = {s: Rotation.from_matrix(rotation) for s, (rotation, _) in calibration.mounts.items()}
    for estimate, track in _both(name, recording, segments, calibration):
        yield estimate.rotated({s: mounts[s] for s in estimate.quats}), track


def track_arm(
    model_file: str, label: str, recording: Recording
) -> Iterator[tuple[OrientationEstimate, Track]]:
    """The simulated arm of `singular` with one of its model files; the tracks hold the joint angles."""
    for estimate, track in _both(model_file, recording, ARM):
        yield replace(estimate, name=estimate.name.replace("Oarlock", f"Oarlock {label}")), track


def _tracked(
    name: oarlock.Model | str,
    recording: Recording,
    frames: Iterable[str],
    calibration: Calibration | None = None,
    config: Config | None = None,
) -> Iterator[OrientationEstimate]:
    return (estimate for estimate, _ in _both(name, recording, frames, calibration, config))


def _both(
    model: oarlock.Model | str,
    recording: Recording,
    frames: Iterable[str],
    calibration: Calibration | None = None,
    config: Config | None = None,
) -> Iterator[tuple[OrientationEstimate, Track]]:
    """Track with a model, a shipped one or a model file, then smooth."""
    try:
        model = oarlock.load_model(model) if isinstance(model, str) else model
    except oarlock.ModelError as error:
        raise NotRunError(f"no model: {str(error).splitlines()[0]}") from error
    try:
        live = oarlock.track(model, _with_nominal(recording, model), calibration, config)
        both = live, oarlock.smooth(live)
    except oarlock.DivergedError as error:
        raise NotRunError(f"lost the track: {error}") from error
    names = tuple(frames)
    return ((estimate_of(n, t, names, online=t is live), t) for n, t in zip(NAMES, both, strict=True))


def _with_nominal(recording: Recording, model: oarlock.Model) -> Recording:
    """The streams that the model has a sensor for."""
    with_nominal = [stream for stream in recording.names if stream in model.sensor_names]
    if not with_nominal:
        raise NotRunError(f'model "{model.name}" has none of the sensors {", ".join(recording.names)}')
    return recording.only(with_nominal)


def estimate_of(label: str, track: Track, frames: Iterable[str], *, online: bool) -> OrientationEstimate:
    """The orientations of these frames in a track."""
    if not hasattr(track, "frame_quat_wxyz"):
        raise NotRunError("this version of Oarlock gives no orientations of frames")
    quats = {frame: np.asarray(track.frame_quat_wxyz(frame, relative_to="root")) for frame in frames}
    return OrientationEstimate(label, np.asarray(track.time_s), quats, online)
