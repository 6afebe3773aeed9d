"""NEES and NIS: do errors and innovations agree with the covariances of the filter? Used by `evaluate`.

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking and Navigation", Wiley
2001, section 5.4: the normalised estimation error squared (NEES) and the normalised innovation squared (NIS) of a
consistent filter are chi-square distributed with as many degrees of freedom as states or measurements. Both are given
here per state and per measurement, so that 1 is expected.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oarlock.evaluation.interval import Interval, beliefs_of, info_of
from oarlock.evaluation.resample import resample, resample_rotation
from oarlock.evaluation.scores import SensorScore, StateScore
from oarlock.model.coordinates import Kind, parts
from oarlock.model.rotation import quat_from_rotvec, rotvec_between, wrap
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import chi2_quantile
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.records import Beliefs
from oarlock.tracking.track import Track


def interval_95(degrees: float) -> tuple[float, float]:
    """The 95 % interval of a chi-square variable divided by its degrees of freedom; NaN for zero degrees."""
    if degrees <= 0:
        return float("nan"), float("nan")
    return float(chi2_quantile(0.025, degrees)) / degrees, float(chi2_quantile(0.975, degrees)) / degrees


def sensor_scores(track: Track, window: Interval) -> tuple[SensorScore, ...]:
    """NIS per reading of every sensor and closure in the window, and the counts of each stream over the whole track.

    NIS per reading is the sum of NIS over the sum of used readings, its degrees of freedom. The last score,
    `all inertial`, treats all inertial units of a sample as one measurement with their joint covariance. Units on one
    body share the body's uncertainty, so only this NIS is expected to be 1. The NIS of a single unit is smaller if the
    body's motion is less certain than the unit's noise. Source: Bar-Shalom et al. 2001, section 5.4.2.
    """
    info = info_of(track)
    if info is None:
        return ()
    kept = window.of(track.time_s)
    counts = {count.name: count for count in track.counts}
    scores = [
        _score(name, info.nis[kept, k], info.used[kept, k], counts.get(name))
        for k, name in enumerate(info.sensor_names)
        if name in counts or info.used[:, k].any() or info.rejected[:, k].any()
    ]
    inputs = [_score(name, _NONE, _NONE, counts[name]) for name in counts if name not in info.sensor_names]
    together = _score(ALL_INERTIAL, info.inertial_nis[kept], info.inertial_used[kept], None)
    return (*scores, *inputs, *([together] if np.isfinite(together.nis) else []))


ALL_INERTIAL = "all inertial"
"""Name of the score of all inertial units together."""
_NONE = np.zeros(0)


def _score(name: str, nis: Floats, used: NDArray[Any], count: StreamCount | None) -> SensorScore:
    counted = np.isfinite(nis) & (used > 0)
    degrees = int(used[counted].sum())
    value = float(nis[counted].sum() / degrees) if degrees else float("nan")
    return SensorScore(name, value, interval_95(degrees), count)


def state_score(track: Track, truth: Track, window: Interval, joints: Sequence[str]) -> StateScore | None:
    """NEES per state of the given joints' angles, velocities and accelerations, with their full covariance.

    ``joints`` are named as their scores are (`pelvis.rotation`). The error of a rotation is the rotation from truth to
    mean in the child's axes, which are also the axes of its covariance. Rates in the child's axes are subtracted. A
    state is included if the truth has it. Beliefs whose covariance is not positive definite are counted and left out.
    Returns None if the track has no beliefs in the window. Source: Bar-Shalom et al. 2001, section 5.4.2.
    """
    beliefs = beliefs_of(track)
    if beliefs is None:
        return None
    error = _state_errors(beliefs, track, truth, joints)
    total, degrees, count, singular = 0.0, 0, 0, 0
    for b in np.flatnonzero(window.of(beliefs.time_s)):
        known = np.flatnonzero(np.isfinite(error[b]))
        if not len(known):
            continue
        nees = _nees(error[b, known], beliefs.covariance[b][np.ix_(known, known)])
        if np.isnan(nees):
            singular += 1
            continue
        total, degrees, count = total + nees, degrees + len(known), count + 1
    if not degrees and not singular:
        return None
    value = total / degrees if degrees else float("nan")
    return StateScore(value, interval_95(degrees), count, degrees, singular)


def _state_errors(beliefs: Beliefs, track: Track, truth: Track, joints: Sequence[str]) -> Floats:
    """Mean minus truth, (B, n); NaN for states without a true value."""
    error = np.full(beliefs.mean.shape, np.nan)
    states = list(beliefs.state_names)
    known = {part.name: part for part in parts(truth.coordinate_names)}
    for part in parts(track.coordinate_names):
        other = known.get(part.name)
        if part.name not in joints or other is None or other.kind != part.kind:
            continue
        turns = track[part.joint].unit != "m" and part.kind != "position"
        for suffix, values in (("", truth.q), (".velocity", truth.qd), (".acceleration", truth.qdd)):
            names = [f"{track.coordinate_names[column]}{suffix}" for column in part.columns]
            if set(names) <= set(states):
                rows = [states.index(name) for name in names]
                true = (truth.time_s, values[:, list(other.columns)])
                kind = part.kind if not suffix and turns else "position"
                error[:, rows] = _minus(beliefs.mean[:, rows], beliefs.time_s, *true, kind)
    return error


def _minus(mean: Floats, at_s: Floats, time_s: Floats, true: Floats, kind: Kind) -> Floats:
    """Mean (B, k) minus truth (T, k); differences of circular coordinates are wrapped."""
    if kind == "rotation":
        expected = resample_rotation(time_s, quat_from_rotvec(true), at_s)
        return -rotvec_between(quat_from_rotvec(mean), expected)
    circular = kind == "scalar"
    error = mean - np.stack([resample(time_s, column, at_s, circular=circular) for column in true.T], axis=1)
    return wrap(error) if circular else error


def _nees(error: Floats, covariance: Floats) -> float:
    """The quadratic form e' P^-1 e; NaN if P is not positive definite. Scaled to unit variance: units differ."""
    variance = np.diag(covariance)
    if not np.all(np.isfinite(covariance)) or np.any(variance <= 0):
        return float("nan")
    scale = 1 / np.sqrt(variance)
    unit_error = error * scale
    try:
        factor = np.linalg.cholesky(covariance * np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return float("nan")
    return float(np.sum(np.linalg.solve(factor, unit_error) ** 2))
