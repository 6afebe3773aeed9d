"""`evaluate`: errors of a track against ground truth, and consistency of its standard deviations.

Every score is computed at the time stamps of the track. Fields are in SI and radians; ``rows`` and ``table`` show
degrees for hinges and millimetres for slides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock.evaluation.common_clock import on_clock_of
from oarlock.evaluation.consistency import sensor_scores, state_score
from oarlock.evaluation.errors import landmark_frames, position_scores
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.joints import joint_scores
from oarlock.evaluation.scores import Evaluation
from oarlock.storage.epoch import moment_text
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, share, shown
from oarlock.tracking.track import Track


def evaluate(
    track: Track,
    truth: Track,
    start_s: float = 2.0,
    frames: Sequence[str] | None = None,
    *,
    progress: Progress = None,
) -> Evaluation:
    """Score a track against ground truth.

    Args:
        track: the estimate.
        truth: interpolated by a cubic spline, not across gaps; on the same clock, or both with epochs.
        start_s: time after the first stamp that is not scored.
        frames: whose positions are scored; default: shoulders, elbows, wrists and hands, or ends of the tree.
        progress: True shows a bar.

    Returns:
        RMSE, bias, correlation, coverage of 95 % bands, NEES and NIS (Bar-Shalom, Li, Kirubarajan 2001,
        "Estimation with Applications to Tracking and Navigation", section 5.4).

    Raises:
        DataError: no common time after ``start_s``.
    """
    truth = on_clock_of(track, truth)
    window = Interval.after(track.time_s, start_s)
    _require_overlap(track, truth, window)
    names = landmark_frames(track, truth) if frames is None else tuple(frames)
    with shown(progress, "scoring") as told:
        joints = joint_scores(track, truth, window)
        positions = position_scores(track, truth, window, names, share(told, 0.1, 1.0))
    scored = tuple(score.name for score in joints if score.observed)
    return Evaluation(
        joints=joints,
        positions=positions,
        states=state_score(track, truth, window, scored),
        sensors=sensor_scores(track, window),
        start_s=float(start_s),
        samples=int(np.count_nonzero(window.of(track.time_s))),
    )


def _require_overlap(track: Track, truth: Track, window: Interval) -> None:
    inside = Interval(float(truth.time_s[0]), float(truth.time_s[-1])) if len(truth.time_s) else None
    kept = window.of(track.time_s)
    if not kept.any():
        raise DataError(
            f"nothing to evaluate: the track covers {_span(track)} and scoring starts at "
            f"{window.start_s:.3f} s. Try a smaller start_s."
        )
    if inside is None or not (kept & inside.of(track.time_s)).any():
        raise DataError(
            f"track and truth do not overlap: the track covers {_span(track)}, the truth {_span(truth)}, and "
            f"scoring starts at {window.start_s:.3f} s. Check that both use the same clock"
            + (f"; time 0 is {moment_text(track.epoch)}." if track.epoch and truth.epoch else ".")
        )


def _span(track: Track) -> str:
    if not len(track.time_s):
        return "no samples"
    return f"{track.time_s[0]:.3f} to {track.time_s[-1]:.3f} s"
