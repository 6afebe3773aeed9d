"""Entry point of the clock calibration (`calibrate_clocks`): reference, coarse search, fine search, acceptance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from oarlock._core import Model
from oarlock.calibration.clocks.coarse import coarse_delays
from oarlock.calibration.clocks.devices import most_agree, reference_streams, same_stamps, unknowns
from oarlock.calibration.clocks.joint_misfit import offsets_of_units
from oarlock.calibration.clocks.lines import after
from oarlock.calibration.clocks.scores import Filtering, bare
from oarlock.calibration.clocks.search import SAME_CLOCK_STDS, Clocks, settle, with_clocks
from oarlock.model.edit import document_of
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, shown
from oarlock.tracking.known_streams import known_streams
from oarlock.tracking.tracking import admit

LARGEST_STD_S = 0.003


def calibrate_clocks(
    model: Model,
    recording: Recording,
    calibration: Calibration | None = None,
    *,
    reference: str | Iterable[str] | None = None,
    jobs: int | None = None,
    progress: Progress = None,
) -> Calibration:
    """Estimate offset and drift of each stream's clock from ordinary movement.

    The filter runs on parts of the recording. It also propagates the sensitivity of the innovations to a delay of each
    stream, both direct and through the state (Friedland 1969). In windows of five seconds, least squares estimates the
    delays that explain the innovations best, together with mounts, lengths, sensor positions and encoder zeros. A line
    is fitted through the delays of the windows, and the search repeats until it converges. Clock errors of up to half
    a second are first reduced by correlating the norms of the readings.

    Args:
        model: the body and its sensors.
        recording: measured streams. It is not modified or resampled.
        calibration: the calibration of this session, if there is one. The search starts from its clocks.
        reference: the stream or streams with the reference clock. None takes the largest group of streams with
            identical time stamps (such as a logger with its encoders), or, if no two streams share theirs, the clock
            on which most streams agree.
        jobs: number of parts tracked at a time; None uses all cores.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        The calibration with `clocks`: offset (s) at t = 0 of the recording's time axis, drift (s per s), and standard
        deviations. A stream with too little movement keeps its clock; ``noted["clocks"]`` names it and the reason.

    Raises:
        DataError: as `oarlock.track`; or all streams have one clock, they overlap by less than eight seconds, or the
            reference does not exist.
    """
    recording, _ = known_streams(model, recording)
    admit(model, recording)
    known = calibration if calibration is not None else Calibration()
    measured = known.corrected(recording)
    fixed = reference_streams(measured, reference)
    groups = unknowns(measured, fixed)
    if not groups or len(groups) + bool(fixed) < 2:
        raise DataError(
            f"calibrate_clocks: all streams ({', '.join(recording.names)}) have the reference's clock; there is "
            "nothing to compare. Name fewer streams as the reference"
        )
    rough = {name: Clock(delay) for name, delay in coarse_delays(measured, fixed).items()}
    start = with_clocks(measured, rough)
    # Joints of persons slide, so that innovations of a tree show more than clocks where nothing holds them in the room.
    is_free = any(joint.kind == "free" for joint in model.describe().joints)
    is_person = document_of(model).get("links", {}).get("joints") == "bone"
    if is_free and is_person and model.structure == "strapdown":
        with shown(progress, "calibrating clocks") as told:
            near = offsets_of_units(model, start, bare(known), groups, told or _nobody)
        found = {name: after(rough.get(name, Clock(0.0)), clock) for name, clock in near.items()}
        return _noted(known, found, fixed, rough, {})
    seen_by = Filtering(model, bare(known), groups, bool(fixed), jobs)
    with shown(progress, "calibrating clocks") as told:
        near = settle(seen_by, start, told or _nobody)
    found = {name: after(rough.get(name, Clock(0.0)), clock) for name, clock in near.items()}
    if not fixed:
        fixed, found = _by_majority(found, measured)
    kept, refused = _judged(measured, found, fixed)
    return _noted(known, kept, fixed, rough, refused)


def _noted(
    known: Calibration, kept: Clocks, fixed: Sequence[str], rough: Clocks, refused: dict[str, str]
) -> Calibration:
    whole = {n: after(known.clocks.get(n, Clock(0.0)), clock) for n, clock in kept.items()}
    noted = {"reference": list(fixed), "coarse": sorted(rough), "refused": refused}
    return replace(known, clocks=dict(known.clocks) | whole, noted=dict(known.noted) | {"clocks": noted})


def _nobody(_share: float) -> None:
    return None


def _by_majority(found: Clocks, recording: Recording) -> tuple[tuple[str, ...], Clocks]:
    """Make the largest group of agreeing clocks the reference, and express the other clocks relative to it."""
    middle = 0.5 * (recording.start_s + recording.end_s)
    agreed = most_agree({n: c for n, c in found.items() if _is_determined(c, middle)}, middle)
    if not agreed:
        return agreed, found
    theirs = [found[n] for n in agreed]
    # An uncertain clock may agree by chance; a median keeps it from moving all others.
    drift = _median([c.drift for c in theirs], [c.drift_std**-2 for c in theirs])
    ways = [c.offset_s + c.drift * middle for c in theirs]
    offset = _median(ways, [1.0 / _middle_variance(c, middle) for c in theirs]) - drift * middle
    moved = {
        n: replace(c, offset_s=c.offset_s - offset, drift=c.drift - drift)
        for n, c in found.items()
        if n not in agreed
    }
    return agreed, moved


def _median(values: Sequence[float], weights: Sequence[float]) -> float:
    """The weighted median, linear between the values."""
    order = np.argsort(values)
    held = np.array(weights)[order]
    return float(np.interp(0.5, (np.cumsum(held) - 0.5 * held) / held.sum(), np.array(values)[order]))


def _middle_variance(clock: Clock, middle_s: float) -> float:
    """Variance of a clock's offset in the middle of the recording, s2."""
    return clock.offset_std_s**2 - (middle_s * clock.drift_std) ** 2


def _is_determined(clock: Clock, middle_s: float) -> bool:
    """Whether the standard deviation of its offset in the middle of the recording is small enough."""
    return bool(_middle_variance(clock, middle_s) <= LARGEST_STD_S**2)


def _judged(recording: Recording, found: Clocks, fixed: Sequence[str]) -> tuple[Clocks, dict[str, str]]:
    """Clocks that are determined well enough, and for the others the reason of their rejection."""
    middle = 0.5 * (recording.start_s + recording.end_s)
    kept, refused = {}, {}
    for name, clock in found.items():
        shared = any(same_stamps(recording[name], recording[other]) for other in fixed if other in recording)
        way = clock.offset_s + clock.drift * middle
        if np.isnan(clock.offset_std_s):
            refused[name] = (
                "no part of the recording could be tracked well enough to estimate its clock. Check mounts and sensors "
                "first: run oarlock track and read its notes"
            )
        elif not _is_determined(clock, middle):
            refused[name] = (
                f"the standard deviation of its clock offset is {1e3 * clock.offset_std_s:.1f} ms; "
                f"at most {1e3 * LARGEST_STD_S:g} ms are accepted. Record faster or longer movement of its link"
            )
        elif shared and abs(way) <= SAME_CLOCK_STDS * clock.offset_std_s:
            refused[name] = (
                f"shares its time stamps with the reference, and {1e3 * way:+.1f} ms is not significant: unchanged"
            )
        else:
            kept[name] = clock
    return kept, refused
