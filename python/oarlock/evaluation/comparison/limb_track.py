"""`track_independent_chains`: an independent filter for each limb, merged into one track."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock._core import Config
from oarlock.evaluation.comparison.direct_readings import direct_readings
from oarlock.evaluation.comparison.limbs import SHARED, Limb, cut_into_limbs
from oarlock.evaluation.resample import resample, resample_rotation
from oarlock.model.coordinates import joint_columns, parts
from oarlock.model.rotation import quat_from_rotvec, rotvec_from_quat
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, share, shown
from oarlock.tracking.known_streams import known_streams
from oarlock.tracking.records import Beliefs
from oarlock.tracking.track import Track, track_without_filter
from oarlock.tracking.tracking import admit, track

if TYPE_CHECKING:
    from oarlock._core import Model


_ESTIMATES = ("q", "qd", "qdd", "q_std", "qd_std", "qdd_std")


def track_independent_chains(
    model: Model,
    recording: Recording,
    calibration: Calibration | None = None,
    config: Config | None = None,
    *,
    progress: Progress = None,
) -> Track:
    """Track every limb by an independent filter on its own chain, as was common before filters of whole bodies.

    After L. Peppoloni, A. Filippeschi, E. Ruffaldi and C. A. Avizzano (2013), "A novel 7 degrees of freedom model
    for upper limb kinematic reconstruction based on wearable sensors", IEEE SISY: one arm, one filter. If several limbs
    share joints, an additional filter without limbs estimates these joints. Each limb's filter includes them as
    states, to estimate the motion of its base, and its estimates of them are discarded. The filters exchange no
    information: the covariance is block-diagonal.

    Args:
        model: a tree with at least two limbs.
        recording: measured streams; each filter receives those of its own sensors.
        calibration: calibration of this session.
        config: settings of every filter; `closures = False` leaves the ends of limbs free, as in the source. Each limb
            is a tree unless `structure` says otherwise.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Raises:
        DataError: the model has fewer than two limbs, or one part has no recorded stream.
        DivergedError: a filter diverged.
    """
    config = Config() if config is None else config
    config = Config(**config.to_dict() | {"structure": config.structure or "tree"})
    recording, _ = known_streams(model, recording)
    admit(model, corrected(recording, calibration))
    limbs = cut_into_limbs(model, config.closures)
    tracks, cpu_s = [], 0.0
    with shown(progress, "tracking limbs") as told:
        for i, limb in enumerate(limbs):
            limb_progress = share(told, i / len(limbs), (i + 1) / len(limbs))
            part = _streams_of(limb, recording)
            began_s = time.thread_time()
            tracks.append(
                track(limb.model, part, _limb_calibration(limb, calibration), config, progress=limb_progress)
            )
            cpu_s += time.thread_time() - began_s
    return _merged(model, recording, calibration, limbs, tracks, cpu_s)


def _streams_of(limb: Limb, recording: Recording) -> Recording:
    inputs = [j.name for j in limb.model.describe().inputs]
    known = {*limb.model.sensor_names, *inputs}
    names = [name for name in recording.names if name in known]
    if not names:
        raise DataError(
            f'limb "{limb.name}": the recording has no stream of its sensors ({", ".join(sorted(known)) or "none"}). '
            "Use ukf, which tracks the whole body."
        )
    return recording.only(names)


def _limb_calibration(limb: Limb, calibration: Calibration | None) -> Calibration | None:
    """The part of a calibration that applies to the limb."""
    if calibration is None:
        return None
    names = set(limb.model.sensor_names)
    mounts = {name: mount for name, mount in calibration.mounts.items() if name in names}
    offsets = {name: offset for name, offset in calibration.mag_offsets_ut.items() if name in names}
    # The limb's recording and model use the other entries as far as they contain their names.
    return replace(calibration, mounts=mounts, mag_offsets_ut=offsets)


def _merged(
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    limbs: tuple[Limb, ...],
    tracks: list[Track],
    cpu_s: float,
) -> Track:
    """One track at the time stamps of the longest; splines interpolate the estimates of the others."""
    time_s = max((t.time_s for t in tracks), key=len)
    n = len(model.coordinate_names)
    arrays: dict[str, Floats] = {name: np.full((len(time_s), n), np.nan) for name in _ESTIMATES}
    observed = np.zeros((len(time_s), n), dtype=bool)
    whole = joint_columns(model.coordinate_names)
    for limb, part in zip(limbs, tracks, strict=True):
        own = joint_columns(part.coordinate_names)
        to = [c for joint in limb.own for c in whole[joint]]
        from_ = [c for joint in limb.own for c in own[joint]]
        for name in _ESTIMATES:
            arrays[name][:, to] = _at(part, name, time_s)[:, from_]
        nearest = np.clip(np.searchsorted(part.time_s, time_s), 0, len(part.time_s) - 1)
        observed[:, to] = part.observed[nearest][:, from_]
    answered = {joint for limb in limbs for joint in limb.own}
    inputs = {joint.name for joint in model.describe().inputs} - answered
    for name, value in direct_readings(model, corrected(recording, calibration), time_s)[0].items():
        if name in inputs:
            arrays["q"][:, whole[name][0]] = value
    steps, wall_s = max(len(t.time_s) for t in tracks), sum(t.provenance["wall_s"] for t in tracks)
    sized = model.with_parameters(calibration.parameters) if calibration is not None else model
    made: dict[str, Any] = dict(arrays)
    return track_without_filter(
        sized,
        time_s,
        **made,
        observed=observed,
        beliefs=_beliefs(limbs, tracks),
        notes=_notes(limbs, tracks),
        provenance={
            **{
                key: tracks[0].provenance[key]
                for key in ("oarlock", "config", "epoch")
                if key in tracks[0].provenance
            },
            "model": model.name,
            "parameters": dict(sized.parameters),
            "filter": "limbs",
            "limbs": {limb.name: list(limb.own) for limb in limbs},
            "steps": steps,
            "wall_s": wall_s,
            "filter_cpu_s": cpu_s,
            "steps_per_s": steps / wall_s,
        },
    )


def _at(part: Track, name: str, time_s: Floats) -> Floats:
    """An array (T, n) of a track at other time stamps."""
    values: Floats = getattr(part, name)
    if len(part.time_s) == len(time_s) and np.array_equal(part.time_s, time_s):
        return values
    found = np.stack([resample(part.time_s, column, time_s) for column in values.T], axis=1)
    for piece in parts(part.coordinate_names) if name == "q" else ():
        if piece.kind == "rotation":
            columns = list(piece.columns)
            turned = resample_rotation(part.time_s, quat_from_rotvec(values[:, columns]), time_s)
            found[:, columns] = rotvec_from_quat(turned)
    return found


def _beliefs(limbs: tuple[Limb, ...], tracks: list[Track]) -> Beliefs | None:
    """Beliefs of all joints with zero covariance between limbs; None unless all limbs stored them at the same times."""
    kept = [t.beliefs for t in tracks]
    if any(b is None for b in kept):
        return None
    beliefs = [b for b in kept if b is not None]
    first = beliefs[0].time_s
    if any(len(b.time_s) != len(first) or np.abs(b.time_s - first).max(initial=0.0) > 1e-9 for b in beliefs):
        return None
    chosen = [_own_states(limb, b) for limb, b in zip(limbs, beliefs, strict=True)]
    mean = np.hstack([b.mean[:, rows] for rows, b in zip(chosen, beliefs, strict=True)])
    covariance = np.zeros((len(first), mean.shape[1], mean.shape[1]))
    at = 0
    for rows, b in zip(chosen, beliefs, strict=True):
        covariance[:, at : at + len(rows), at : at + len(rows)] = b.covariance[:, rows][:, :, rows]
        at += len(rows)
    names = [b.state_names[i] for rows, b in zip(chosen, beliefs, strict=True) for i in rows]
    return Beliefs(first, mean, covariance, tuple(names))


def _own_states(limb: Limb, beliefs: Beliefs) -> list[int]:
    sensors = set(limb.model.sensor_names) - set(limb.own)
    return [
        i
        for i, name in enumerate(beliefs.state_names)
        if name.partition(".")[0] in limb.own and name.partition(".")[0] not in sensors and "bias" not in name
    ]


def _notes(limbs: tuple[Limb, ...], tracks: list[Track]) -> tuple[str, ...]:
    names = ", ".join("what they share" if limb.name == SHARED else limb.name for limb in limbs)
    notes: list[str] = [f"each limb is tracked by a separate filter: {names}"]
    for limb, part in zip(limbs, tracks, strict=True):
        notes += [f"{limb.name}: {note}" for note in part.notes]
    return tuple(dict.fromkeys(notes))
