"""Finds where a video lies in a track's time from what moves in both, and says when several offsets fit equally well.

track time = offset_s + (1 + 1e-6 drift_ppm) * video time.

At each offset the courses of picture and body are compared by their canonical correlations r (Hotelling 1936), because
neither the camera's place nor its direction is known: -sum(log(1 - r^2)) is twice their mutual information if both are
Gaussian. Times the number of independent samples it is the log of a likelihood ratio, by which offsets are compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import correlate, find_peaks

from oarlock.movement.video.signals import HIGHEST_HZ, STEP_S, Signals
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError

LEAST_OVERLAP_S = 4.0
MARGIN = 25.0
"""An offset is excluded if it is worse by this: 2 log of a likelihood ratio of 3e5, as some hundred offsets compete."""
LEAST_CORRELATION = 0.5
RIDGE = 1e-3
"""Of each course's variance over the whole: at rest two courses of noise shall not agree by chance."""
MOST_CANDIDATES = 12
APART_S = 0.3
"""Peaks nearer than this are one offset."""


@dataclass(frozen=True)
class OffsetCandidate:
    """An offset that fits, s, and by how much it is worse than the best: 2 log of the likelihood ratio."""

    offset_s: float
    worse_by: float


@dataclass(frozen=True)
class VideoAlignment:
    """Where a video lies in a track's time.

    Attributes:
        offset_s: track time at video time 0, s.
        std_s: standard deviation of the offset, s: of the fit, and of a time within one picture.
        drift_ppm: by how many millionths the track's clock runs faster than the video's; 0 if it was not fitted.
        drift_std_ppm: its standard deviation; NaN if it was not fitted.
        correlation: the largest canonical correlation of picture and body.
        overlap_s: time that both cover, s.
        candidates: further offsets that cannot be excluded, the best first.
    """

    offset_s: float
    std_s: float
    drift_ppm: float
    drift_std_ppm: float
    correlation: float
    overlap_s: float
    candidates: tuple[OffsetCandidate, ...]

    @property
    def ambiguous(self) -> bool:
        """Whether other offsets fit as well."""
        return bool(self.candidates)

    def require_one(self) -> None:
        """Refuse an ambiguous alignment.

        Raises:
            DataError: several offsets fit; they are listed.
        """
        if self.ambiguous:
            listed = ", ".join(f"{one.offset_s:.2f}" for one in self.candidates)
            raise DataError(
                f"video: the movement repeats itself, so {1 + len(self.candidates)} offsets fit equally well: "
                f"{self.offset_s:.2f} s, also {listed} s. A start, a stop or a change of rate in view would decide. "
                "Look which one is right and give it as --offset-s, limit the search with --near-s, or align by a clap"
            )


@dataclass(frozen=True)
class _LaggedSignals:
    """Courses of picture and body on one grid; the body's row is the picture's plus `lag`."""

    picture: Signals
    body: Signals
    independent_hz: float = 2.0 * HIGHEST_HZ

    @cached_property
    def scaled(self) -> tuple[Floats, Floats]:
        """Courses of picture and body with variance 1 over the whole."""
        return _scaled(self.picture), _scaled(self.body)

    def offset_s(self, lag: float) -> float:
        return float(self.body.start_s + STEP_S * lag - self.picture.start_s)


def align(
    picture: Signals,
    body: Signals,
    *,
    near_s: float | None = None,
    within_s: float = 2.0,
    frame_s: float = 0.04,
) -> VideoAlignment:
    """Find the offset of a video from the motion of its picture.

    Args:
        picture: courses of the picture's motion, in video time.
        body: courses of the body's motion, in track time.
        near_s: search near this offset only, s; None: every offset with at least 4 s in common.
        within_s: half of the width of that search, s.
        frame_s: time from picture to picture, s.

    Raises:
        DataError: too little in common, or picture and body move unlike each other at every offset.
    """
    fit = _LaggedSignals(picture, body)
    lags, score, count = _scores(fit)
    allowed = count * STEP_S >= min(
        LEAST_OVERLAP_S, 0.5 * STEP_S * min(len(picture.values), len(body.values))
    )
    if near_s is not None:
        allowed &= np.abs(fit.offset_s(0.0) + STEP_S * lags - near_s) <= within_s
    if not allowed.any():
        where = "" if near_s is None else f" at an offset of {near_s:g} +- {within_s:g} s"
        raise DataError(
            f"video: picture and track have less than {LEAST_OVERLAP_S:g} s in common{where}; "
            "check that they belong together"
        )
    peaks = _peaks(np.where(allowed, score * count, -np.inf))
    best = _champion(fit, lags[peaks])
    independent_hz, correlation = _independence(fit, best)
    fit = _LaggedSignals(picture, body, independent_hz)
    at = int(np.flatnonzero(lags == best)[0])
    _require_likeness(fit, score[at], float(count[at]), correlation, int(allowed.sum()))
    offset_s, std_s = _refined(fit, best, score[at - 1 : at + 2], float(count[at]))
    rivals = [
        (lag, worse) for lag in lags[peaks] if lag != best and (worse := _worse_by(fit, best, lag)) < MARGIN
    ]
    rivals.sort(key=lambda one: one[1])
    overlap_s = STEP_S * float(count[at])
    return VideoAlignment(
        offset_s=offset_s,
        # a picture stands for a moment somewhere within its time
        std_s=float(np.hypot(std_s, frame_s / np.sqrt(12.0))),
        drift_ppm=0.0,
        drift_std_ppm=float("nan"),
        correlation=correlation,
        overlap_s=overlap_s,
        candidates=tuple(
            OffsetCandidate(fit.offset_s(lag), max(0.0, worse)) for lag, worse in rivals[:MOST_CANDIDATES]
        ),
    )


def _scores(fit: _LaggedSignals) -> tuple[Ints, Floats, Floats]:
    """All lags, and at each the score and the number of common samples."""
    p, b = fit.scaled
    mp, mb = fit.picture.valid.astype(float), fit.body.valid.astype(float)
    p, b = p * mp[:, None], b * mb[:, None]

    def slid(of_body: Floats, of_picture: Floats) -> Floats:
        found: Floats = correlate(of_body, of_picture, mode="full", method="fft")
        return found

    count = np.rint(slid(mb, mp))
    n = np.maximum(count, 1.0)
    mean_p = np.stack([slid(mb, column) for column in p.T], -1) / n[:, None]
    mean_b = np.stack([slid(column, mp) for column in b.T], -1) / n[:, None]
    kp, kb = p.shape[1], b.shape[1]
    pp = np.stack([slid(mb, p[:, i] * p[:, j]) for i in range(kp) for j in range(kp)], -1)
    bb = np.stack([slid(b[:, i] * b[:, j], mp) for i in range(kb) for j in range(kb)], -1)
    pb = np.stack([slid(b[:, j], p[:, i]) for i in range(kp) for j in range(kb)], -1)
    cpp = (pp / n[:, None]).reshape(-1, kp, kp) - mean_p[:, :, None] * mean_p[:, None, :]
    cbb = (bb / n[:, None]).reshape(-1, kb, kb) - mean_b[:, :, None] * mean_b[:, None, :]
    cpb = (pb / n[:, None]).reshape(-1, kp, kb) - mean_p[:, :, None] * mean_b[:, None, :]
    lags = np.arange(len(count)) - (len(p) - 1)
    return lags, np.where(count > 0, _information(cpp, cbb, cpb), 0.0), count


def _scaled(signals: Signals) -> Floats:
    spread = signals.values[signals.valid].std(axis=0)
    return signals.values / np.where(spread > 0.0, spread, 1.0)


def _information(cpp: Floats, cbb: Floats, cpb: Floats) -> Floats:
    """-sum(log(1 - r^2)) of canonical correlations r, for covariances (..., K, K), (..., M, M), (..., K, M)."""
    cpp = cpp + RIDGE * np.eye(cpp.shape[-1])
    cbb = cbb + RIDGE * np.eye(cbb.shape[-1])
    explained = np.swapaxes(cpb, -1, -2) @ np.linalg.solve(cpp, cpb)
    score: Floats = np.linalg.slogdet(cbb)[1] - np.linalg.slogdet(cbb - explained)[1]
    return score


def _peaks(evidence: Floats) -> Ints:
    """Local maxima of the evidence that are at least a third of the largest, the largest first."""
    floor = float(np.where(np.isfinite(evidence), evidence, 0.0).min())
    finite = np.where(np.isfinite(evidence), evidence, floor - 1.0)
    found, _ = find_peaks(np.pad(finite, 1, constant_values=floor - 2.0), distance=int(APART_S / STEP_S))
    found = found - 1
    found = found[(found > 0) & (found < len(evidence) - 1) & np.isfinite(evidence[found])]
    if not found.size:
        raise DataError("video: no offset fits better than its neighbours; search a wider range")
    order = found[np.argsort(-evidence[found])]
    high: Ints = order[evidence[order] >= evidence[order[0]] / 3.0]
    return high


def _common(fit: _LaggedSignals, lags: tuple[int, ...]) -> Ints:
    """Rows of the picture that have a partner in the body at all these lags."""
    rows = np.flatnonzero(fit.picture.valid)
    for lag in lags:
        partner = rows + lag
        inside = (partner >= 0) & (partner < len(fit.body.valid))
        rows = rows[inside][fit.body.valid[partner[inside]]]
    return rows


def _score_of(fit: _LaggedSignals, rows: Ints, lag: int) -> float:
    p, b = fit.scaled[0][rows], fit.scaled[1][rows + lag]
    p, b = p - p.mean(axis=0), b - b.mean(axis=0)
    n = len(rows)
    return float(_information(p.T @ p / n, b.T @ b / n, p.T @ b / n))


def _worse_by(fit: _LaggedSignals, best: int, other: int) -> float:
    """2 log of the likelihood ratio of two lags, by pictures with a partner at both; negative if `other` is better.

    Offsets with too little in common are both judged by all of their own pictures.
    """
    rows = _common(fit, (best, other))
    if len(rows) * STEP_S >= LEAST_OVERLAP_S:
        both = [(rows, best), (rows, other)]
    else:
        both = [(_common(fit, (lag,)), lag) for lag in (best, other)]
    one, two = (fit.independent_hz * STEP_S * len(part) * _score_of(fit, part, lag) for part, lag in both)
    return one - two


def _champion(fit: _LaggedSignals, lags: Ints) -> int:
    """The lag that is better than each one it was compared with."""
    best = int(lags[0])
    for lag in lags[1:]:
        if _worse_by(fit, best, int(lag)) < 0.0:
            best = int(lag)
    return best


def _independence(fit: _LaggedSignals, lag: int) -> tuple[float, float]:
    """Independent samples in a second by the residual of the best pair of courses, and that pair's correlation."""
    rows = _common(fit, (lag,))
    p, b = fit.scaled[0][rows], fit.scaled[1][rows + lag]
    p, b = p - p.mean(axis=0), b - b.mean(axis=0)
    white_p, white_b = (
        x @ np.linalg.inv(np.linalg.cholesky(x.T @ x / len(x) + RIDGE * np.eye(x.shape[1]))).T for x in (p, b)
    )
    left, sizes, right = np.linalg.svd(white_p.T @ white_b / len(rows))
    correlation = float(min(sizes[0], 1.0))
    residual = white_b @ right[0] - correlation * (white_p @ left[:, 0])
    residual = residual - residual.mean()
    course = correlate(residual, residual, method="fft")[len(residual) - 1 :]
    course = course / max(float(course[0]), 1e-12)
    negative = np.flatnonzero(course < 0.0)
    until = int(negative[0]) if negative.size else len(course)
    memory_s = STEP_S * (1.0 + 2.0 * float(course[1:until].sum()))
    return min(2.0 * HIGHEST_HZ, 1.0 / memory_s), correlation


def _require_likeness(
    fit: _LaggedSignals, score: float, count: float, correlation: float, offsets: int
) -> None:
    """Refuse a best offset that chance alone would give: under chance the evidence is chi-squared."""
    freedom = fit.picture.values.shape[1] * fit.body.values.shape[1]
    evidence = fit.independent_hz * STEP_S * count * score
    chance = freedom + 2.0 * np.sqrt(2.0 * freedom * np.log(offsets)) + 2.0 * np.log(offsets)
    if correlation < LEAST_CORRELATION or evidence < chance:
        raise DataError(
            f"video: the picture does not move like the track at any offset (best correlation {correlation:.2f}); "
            "check "
            "that they belong together, cut the video to where the person fills the picture, or give --offset-s"
        )


def _refined(fit: _LaggedSignals, lag: int, score: Floats, count: float) -> tuple[float, float]:
    """Offset between the grid's lags by a parabola, and its standard deviation by the curvature there, s."""
    left, middle, right = (float(value) for value in score)
    bend = left - 2.0 * middle + right
    if bend >= 0.0:
        return fit.offset_s(lag), APART_S
    part = 0.5 * (left - right) / bend
    curvature = -bend / STEP_S**2
    std_s = 1.0 / np.sqrt(0.5 * fit.independent_hz * STEP_S * count * curvature)
    return fit.offset_s(lag + part), float(std_s)
