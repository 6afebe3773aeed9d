"""Entry point `calibrate_motion`: fits two noise hypotheses, scores each on held-out data, and keeps the better one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from oarlock.calibration.motion.constants import Constants
from oarlock.calibration.motion.hypothesis import RIGID, SOFT, Hypothesis
from oarlock.calibration.motion.notes import noted
from oarlock.calibration.motion.stretch import CalibrationData
from oarlock.recording.calibration import Calibration
from oarlock.storage.errors import DivergedError
from oarlock.storage.progress import Progress, Told, share, shown

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.recording import Recording

RIGID_NIS = 3.0
"""Innovations of a rigid body are as large as the sensors' noise; three times that in variance is something else."""
BETTER = 0.98
"""What is kept has to be better than before by more than chance: by 2 % on hundreds of samples."""
MOST_SURPRISE = 2.0
"""Prior standard deviations, root mean square of all constants: larger changes are implausible for mounted units."""
# Approximate parts of the duration, for the progress: the plain filter, two hypotheses, the whole part once more.
_SHARES: Final = {"plain": (0.0, 0.05), "rigid": (0.05, 0.35), "soft": (0.35, 0.6), "whole": (0.6, 1.0)}


@dataclass(frozen=True, eq=False)
class CalibrationCandidate:
    """A calibration, and its innovations on the part that it was not fitted to."""

    hypothesis: Hypothesis
    constants: Constants
    calibration: Calibration
    score: float
    own_score: float


def calibrate_motion(
    model: Model,
    recording: Recording,
    calibration: Calibration | None = None,
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    held_out: float = 1.0 / 3.0,
    progress: Progress = None,
) -> Calibration:
    """Estimate mounts, lengths, sensor positions and encoder zeros from ordinary movement of a body with closed loops.

    All constants are states of the tracking filter with priors, which gives a maximum a posteriori estimate. The
    second of two passes linearises about what the first found. Two hypotheses are tested. "rigid": sensors are
    rigidly attached, and the root may rock. It is accepted if the innovations on held-out data are as small as the
    sensors' noise. Otherwise "soft": sensors move with the skin, their errors are time-correlated, a hundred samples
    count as one, and units share a constant displacement on their links, with twice the variance of their priors. A
    result is kept only if its innovations on held-out data are smaller than before.

    Args:
        model: the body and its sensors. Parameters in metres with a `std` are estimated.
        recording: several cycles of ordinary movement: 20 s are sufficient, minutes are better.
        calibration: an earlier calibration; its standard deviations are the priors.
        start_s: start of the part to use, s; None is the start of the recording.
        end_s: end of the part to use, s; None is the end of the recording.
        held_out: share at the end of this part that is held out to score results, 0.1 to 0.5.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        A calibration for `track`. Its `noted` contains `kept` ("rigid", "soft" or "before"), the `scores`, the prior,
        value, standard deviation and reduction of variance of each constant, and `not_told` (hardly determined ones).

    Raises:
        DataError: the part lasts less than 8 s, the model has no inertial unit or closure, or `held_out` is invalid.
        DivergedError: the filter diverges before any constant is estimated.
    """
    known = Calibration() if calibration is None else calibration
    edges = [(start_s, recording.start_s), (end_s, recording.end_s)]
    first_s, last_s = (edge if given is None else given for given, edge in edges)
    with shown(progress, "calibrating") as told:
        part = recording.slice(first_s, last_s)
        stretch = CalibrationData.of(model, known, part, held_out, share(told, *_SHARES["plain"]))
        scores, kept = _searched(stretch, told)
    notes = noted(kept.constants if kept else None, kept.hypothesis.name if kept else "before", scores)
    span = {"stretch_s": [first_s, last_s], "held_out_s": [stretch.rest.start_s, stretch.rest.end_s]}
    older = {"before": dict(known.noted)} if known.noted else {}
    return replace(kept.calibration if kept else known, noted=notes | span | older)


def _searched(
    stretch: CalibrationData, told: Told | None
) -> tuple[dict[str, float], CalibrationCandidate | None]:
    """The scores of all hypotheses, and the first acceptable one, if there is one."""
    before = stretch.held_out_nis(SOFT, stretch.known)
    scores = {"before": before}
    for hypothesis in (RIGID, SOFT):
        part = replace(stretch, told=share(told, *_SHARES[hypothesis.name]))
        found = candidate(part, hypothesis, part.first)
        scores[hypothesis.name] = found.score if found else float("inf")
        if found and acceptable(found, before):
            return scores, with_all_samples(replace(stretch, told=share(told, *_SHARES["whole"])), found)
    return scores, None


def candidate(
    stretch: CalibrationData, hypothesis: Hypothesis, part: Recording
) -> CalibrationCandidate | None:
    """What a hypothesis makes of a part; none if the filter is lost under it."""
    try:
        searched, found = stretch.search(hypothesis, part)
    except DivergedError:
        return None
    constants = found.displaced(hypothesis.displacement)
    parameters = set(stretch.model.parameters)
    calibration = constants.calibration(searched, stretch.known, parameters)
    own = stretch.held_out_nis(hypothesis, calibration)
    score = stretch.held_out_nis(SOFT, calibration) if hypothesis is RIGID else own
    honest = constants.inflated(max(1.0, own))
    calibration = honest.calibration(searched, stretch.known, parameters)
    return CalibrationCandidate(hypothesis, honest, calibration, score, own)


def acceptable(found: CalibrationCandidate, before: float) -> bool:
    """Whether held-out samples and common sense are for it."""
    right = found.hypothesis is not RIGID or found.own_score <= RIGID_NIS
    return right and found.score < BETTER * before and found.constants.surprise() <= MOST_SURPRISE


def with_all_samples(stretch: CalibrationData, found: CalibrationCandidate) -> CalibrationCandidate:
    """The same from the whole stretch, unless that contradicts the held-out part more."""
    again = candidate(stretch, found.hypothesis, stretch.whole)
    stands = again is not None and acceptable(again, found.score / BETTER**2)
    return again if again is not None and stands else found
