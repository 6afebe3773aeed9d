"""Offset and drift of every stream's clock, from the movement that all of them see."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from oarlock._core import Model
from oarlock.calibration.clocks.coarse import coarse_delays
from oarlock.calibration.clocks.devices import most_agree, reference_streams, same_stamps, unknowns
from oarlock.calibration.clocks.lines import after
from oarlock.calibration.clocks.scores import Filtering, bare
from oarlock.calibration.clocks.search import SAME_CLOCK_STDS, Clocks, settle, with_clocks
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock
from oarlock.storage.errors import DataError
from oarlock.tracking.tracking import Progress, admit

Floats = NDArray[np.float64]

LARGEST_STD_S = 0.003


def calibrate_clocks(
    model: Model,
    recording: Recording,
    calibration: Calibration | None = None,
    *,
    reference: str | Iterable[str] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Find by how much each stream's clock is off and how fast it runs, from ordinary movement.

    Pieces of the recording are filtered. How innovations answer to a delay of each stream, directly and through what
    it has done to the state, goes along with the filter (Friedland 1969); in windows of five seconds the delays that
    explain the innovations best are solved for, together with mounts, lengths, places of units and zeros. A line is
    laid through the windows, and all is done again until nothing moves. Clocks that are off by up to half a second are
    first brought near by norms of what streams feel.

    Args:
        model: the body and its sensors.
        recording: measured streams; it does not change, and nothing is resampled.
        calibration: what is known of the wearing; its clocks are where the search begins.
        reference: the stream or streams that keep true time. None takes the most streams that share their stamps (a
            logger with its encoders); where no two do, what most streams agree on.
        threads: how many pieces are tracked at a time; None takes all cores.
        progress: called now and then with the share done, 0 to 1.

    Returns:
        The calibration with `clocks`: offset at t = 0 of the recording's time axis, drift, and standard deviations. A
        stream whose movement tells too little is left as it was; ``noted["clocks"]`` says which, and why.

    Raises:
        DataError: as `oarlock.track`; a single clock, less than eight seconds that all streams share, or a reference
            that is not there.
    """
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
    seen_by = Filtering(model, bare(known), groups, bool(fixed), threads)
    near = settle(seen_by, start, progress or _nobody)
    found = {name: after(rough.get(name, Clock(0.0)), clock) for name, clock in near.items()}
    if not fixed:
        fixed, found = _by_majority(found, measured)
    kept, refused = _judged(measured, found, fixed)
    whole = {n: after(known.clocks.get(n, Clock(0.0)), clock) for n, clock in kept.items()}
    noted = {"reference": list(fixed), "coarse": sorted(rough), "refused": refused}
    return replace(known, clocks=dict(known.clocks) | whole, noted=dict(known.noted) | {"clocks": noted})


def _nobody(_share: float) -> None:
    return None


def _by_majority(found: Clocks, recording: Recording) -> tuple[tuple[str, ...], Clocks]:
    """The streams that most agree on become the reference; the others' clocks are told against theirs."""
    middle = 0.5 * (recording.start_s + recording.end_s)
    agreed = most_agree(found, middle)
    offset = float(np.mean([found[n].offset_s for n in agreed]))
    drift = float(np.mean([found[n].drift for n in agreed]))
    moved = {
        n: replace(c, offset_s=c.offset_s - offset, drift=c.drift - drift)
        for n, c in found.items()
        if n not in agreed
    }
    return agreed, moved


def _judged(recording: Recording, found: Clocks, fixed: Sequence[str]) -> tuple[Clocks, dict[str, str]]:
    """Clocks that are told well enough, and why the others are not taken."""
    middle = 0.5 * (recording.start_s + recording.end_s)
    kept, refused = {}, {}
    for name, clock in found.items():
        shared = any(same_stamps(recording[name], recording[other]) for other in fixed if other in recording)
        way = clock.offset_s + clock.drift * middle
        in_the_middle = np.sqrt(np.maximum(clock.offset_std_s**2 - (middle * clock.drift_std) ** 2, 0.0))
        if np.isnan(in_the_middle):
            refused[name] = (
                "no piece of the recording could be tracked well enough to tell its clock. Check the wearing first: "
                "oarlock track says what does not fit"
            )
        elif not in_the_middle <= LARGEST_STD_S:
            refused[name] = (
                f"its movement tells its clock to {1e3 * clock.offset_std_s:.1f} ms only (standard deviation); "
                f"at most {1e3 * LARGEST_STD_S:g} ms are taken. Record faster movement of its link, or more of it"
            )
        elif shared and abs(way) <= SAME_CLOCK_STDS * clock.offset_std_s:
            refused[name] = (
                f"shares its stamps with the reference, and {1e3 * way:+.1f} ms may as well be chance: kept as it is"
            )
        else:
            kept[name] = clock
    return kept, refused
