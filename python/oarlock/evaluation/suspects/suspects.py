"""`suspects`: names sensor faults (exchanged, inverted, wrong unit, sign, clock or mount, bias) from the readings."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from oarlock.evaluation.suspects.changes import FaultCorrection
from oarlock.evaluation.suspects.fit import MisfitEvaluator, Spent
from oarlock.evaluation.suspects.joint_forces import JointForces, joint_suspects
from oarlock.evaluation.suspects.rest_gravity import RestGravity
from oarlock.evaluation.suspects.search import RATE_HZ, SCREEN_HZ, CorrectionFit, SearchResult, Second, search
from oarlock.evaluation.suspects.second import most_motion, on_grid
from oarlock.evaluation.suspects.suspect import Suspect
from oarlock.evaluation.suspects.turning import own_suspect
from oarlock.recording.corrections import corrected
from oarlock.recording.plausibility import plausibility
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.recording.undetermined_mounts import undetermined_mounts
from oarlock.storage.progress import Progress, shown

if TYPE_CHECKING:
    from oarlock._core import Config, Model
    from oarlock.recording.calibration import Calibration

STILL = 0.1
"""Motion score below which signs and units of moving sensors cannot be determined."""
UNEXPLAINED = 1.5
"""Misfit above which a sensor that contradicts the others is named although no fault explains it."""
ALONE = 2.5
"""Factor by which the misfit of the others must be smaller without that sensor."""
SCALED_S = 6.0
"""Duration of the part that the filter tests for a scale, s. For single units of `arm7` without an encoder the right
scale lowers the misfit in each case over 6 s, but not over 1 s."""


def find_suspects(
    model: Model,
    recording: Recording,
    calibration: Calibration | None = None,
    config: Config | None = None,
    *,
    seconds: float = 1.0,
    budget_s: float = 8.0,
    progress: Progress = None,
) -> tuple[Suspect, ...]:
    """Find sensor faults in a recording.

    Units are compared first: a gyroscope with the magnetic field or the mean force of its own unit, then the force
    at each joint as both of its units read it, with clocks, axes, signs, mounts and biases changed until they agree.
    The scale of a gyroscope must also lower the misfit of its joints; without a joint to another unit, the misfit of a
    filter over 6 s: the acceleration of a swing turns the mean force too.
    If nothing is found, a filter tracks the second with the most movement, which expects the usual errors of real
    recordings: mounts 5 deg off, soft tissue, nearby iron. If the misfit is large, the second is tracked again with
    each of about a hundred faults corrected. The fault is reported whose correction gives a usual misfit and a smaller
    one than any other correction. The search then continues, for up to three faults. Corrections that
    gravity contradicts where a unit rests are not tried. Units whose mounts have no known heading are not compared
    with others.

    Args:
        model: the body and its sensors.
        recording: measured streams; in a live session those received so far.
        calibration: calibration of this session; its corrections are applied first.
        config: settings for closures and magnetometers; None uses the defaults.
        seconds: duration of the part that the filter tests, s.
        budget_s: after which no further fault is tried, s. This is said by a suspect "unfinished".
        progress: True shows that it runs.

    Returns:
        Suspects, the most significant first; empty if the misfit is usual.

    Raises:
        DataError: as `Calibration.corrected`.
    """
    end_s = time.monotonic() + budget_s
    measured = corrected(recording, calibration)
    known = _known(model, measured)
    findings = [f for f in plausibility(measured) if f.severity == "error" or f.kind]
    alone = [Suspect((f.sensor,), f.kind or "reading", str(f)) for f in findings]
    if known is None:
        return tuple(alone)
    still = None if calibration is None else calibration.for_corrected()
    spent = Suspect(
        (), "unfinished", f"the search for faults ended after {budget_s:g} s, before it had tried all."
    )
    judge = MisfitEvaluator(model, still, config.closures if config is not None else True, end_s)
    with shown(progress, "searching for faults"):
        try:
            units, agreeing, is_whole = _by_units(
                model, known, still, {f.sensor for f in findings}, judge, lambda: time.monotonic() > end_s
            )
            by_tracking = units or _by_tracking(model, known, still, judge, seconds, agreeing)
        except Spent:
            by_tracking, is_whole = [], False
    named = {name for suspect in by_tracking if suspect.fault != "untold" for name in suspect.streams}
    others = [suspect for suspect in alone if not named.intersection(suspect.streams)]
    return (*by_tracking, *others, *([] if is_whole else [spent]))


def _by_units(
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    faulty: set[str],
    judge: MisfitEvaluator,
    spent: Callable[[], bool],
) -> tuple[list[Suspect], frozenset[str], bool]:
    """What units show of themselves and of each other; which agree with their neighbours; and whether all was tried."""
    plausible = [s for s in recording if s.name not in faulty]
    sound = [s for s in plausible if isinstance(s, ImuStream)]
    faults = [fault for unit in sound if (fault := own_suspect(unit)) is not None]
    whole = JointForces.of(model, Recording(sound), calibration) if faults else None
    own = [
        suspect
        for suspect, scale in faults
        if suspect.fault != "scale"
        or (
            whole.fits_scale(suspect.streams[0], scale)
            if whole is not None and any(suspect.streams[0] in joint for joint in whole.joints)
            else _lowers_misfit(judge, Recording(plausible), suspect.streams[0], scale)
        )
    ]
    unknown = undetermined_mounts(calibration)
    others = [
        s
        for s in sound
        if s.name not in unknown and all(s.name not in e.streams or e.fault == "bias" for e in own)
    ]
    forces = JointForces.of(model, Recording(others), calibration) if others else None
    gravity = RestGravity.of(model, recording, calibration)
    joints, is_whole = ([], True) if forces is None else joint_suspects(forces, gravity, spent)
    agreeing = frozenset() if forces is None else forces.agreeing()
    return [*own, *joints], agreeing, is_whole


def _lowers_misfit(judge: MisfitEvaluator, recording: Recording, name: str, scale: float) -> bool:
    """Whether the model follows the readings better with the rates of one unit times `scale`."""
    start_s, _ = most_motion(recording, SCALED_S)
    part = on_grid(recording, start_s, SCALED_S, RATE_HZ)
    if part is None:
        return False
    scaled = FaultCorrection("scale", (name,), "", fields=("gyro_rad_s",), matrix=scale).applied(part)
    before, after = judge.misfits([part, scaled])
    return after.total < before.total


def _known(model: Model, recording: Recording) -> Recording | None:
    """The streams for which the model has a sensor or input joint."""
    names = {*model.sensor_names, *(joint.name for joint in model.describe().inputs)}
    kept = [name for name in recording.names if name in names]
    return recording.only(kept) if kept else None


def _by_tracking(
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    judge: MisfitEvaluator,
    seconds: float,
    agreeing: frozenset[str],
) -> list[Suspect]:
    """`agreeing`: units that are not suspected."""
    comparable = [name for name in recording.names if name not in undetermined_mounts(calibration)]
    if not comparable:
        return []
    recording = recording.only(comparable)
    start_s, motion_score = most_motion(recording, seconds)
    grids = [on_grid(recording, start_s, seconds, rate) for rate in (RATE_HZ, SCREEN_HZ)]
    if grids[0] is None or grids[1] is None:
        return []
    gravity = RestGravity.of(model, recording, calibration)
    outcome = search(judge, Second(model, grids[0], grids[1], gravity, agreeing))
    return _suspects_of(outcome, start_s, motion_score)


def _suspects_of(outcome: SearchResult, start_s: float, motion_score: float) -> list[Suspect]:
    if outcome.found:
        return [_of_found(found, start_s) for found in outcome.found]
    total = outcome.misfit.total
    if total > UNEXPLAINED and outcome.contradicts and outcome.without_it * ALONE < total:
        return [
            Suspect(
                (outcome.contradicts,),
                "contradicts",
                f"{outcome.contradicts} contradicts the other sensors, and no known fault explains it. Check its "
                "mount and its readings.",
                total,
                outcome.without_it,
                start_s,
            )
        ]
    if motion_score < STILL:
        return [
            Suspect(
                (),
                "untold",
                "the recording hardly moves: whether gyroscopes and encoders have the right unit and sign cannot be "
                "determined yet.",
                start_s=start_s,
            )
        ]
    return []


def _of_found(found: CorrectionFit, start_s: float) -> Suspect:
    change = found.change
    others = tuple(other.text for other in found.others)
    return Suspect(change.streams, change.fault, change.text, found.before, found.after, start_s, others)
