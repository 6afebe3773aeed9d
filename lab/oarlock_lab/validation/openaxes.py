"""Two links of a robot against its joint encoders: relative orientation, heading set once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock import DataError, Recording
from oarlock.formats.datasets.openaxes import (
    LINK_FROM_SENSOR,
    LINKS,
    openaxes_runs,
    read_openaxes,
    read_openaxes_reference,
)
from oarlock.storage.arrays import Floats

from . import orientations_only, others, ours
from .estimate import OrientationEstimate, Outcome, attempt
from .limits import limits, punctual
from .results import Collected, Plot, SetResult
from .scores import heading_zeroed, median_deg, relative_error_rad, rmse_deg, turn_between_rad
from .worst_window import worst_of, worst_plot

FOLDER = "openaxes_ur5"
HEADING_AT_S = 1.0
SCORED_AFTER_S = 5.0
WINDOW_S = 10.0

PAIR = ("radius", "carpus")
MOUNT = Rotation.from_matrix(LINK_FROM_SENSOR)

TITLE = "Two links of a robot (OpenAXES)"
TEXT = (
    "A UR5 robot moves along circles and triangles; units without magnetometer sit on two neighbouring "
    "links, 125 Hz. The reference comes from the joint encoders. The headings are set to the reference's "
    "at 1 s, once and for all. Scored: the angle between estimated and true relative orientation from "
    "link to link, median after 5 s. The accelerometers are not calibrated (9.4 to 9.5 m/s2 at rest)."
)
PLAIN, REMOVED = "as it stands", "limits and delays removed"
UNAIDED = (
    "The joint between the links tells their relative heading, but hardly within the first second. An estimate that "
    "has found it later is harmed by the rule above. Units by themselves know no relative heading."
)
ORIENTATIONS = (
    "The raw signals go through VQF (6D, causal) and are dropped. Oarlock gets the quaternions as they are, the second "
    "unit's heading being unknown; the other software gets them with both headings set to the reference's at 1 s."
)
LIMITS_TEXT = (
    "How late the encoders' stamps are (negative: early), and how far each unit is off its nominal mount."
)


def run(data_folder: Path) -> SetResult:
    """Score all runs."""
    folder = data_folder / FOLDER
    try:
        runs = openaxes_runs(folder)
    except DataError as error:
        return SetResult(FOLDER, TITLE, TEXT, absent=str(error))
    medians = {name: Collected() for name in (PLAIN, REMOVED)}
    squares, unaided, collected_limits = Collected(), Collected(), Collected()
    plots = [_run(folder, name, medians, squares, unaided, collected_limits) for name in runs]
    forced = Collected()
    for name in runs:
        _run_orientations(folder, name, forced)
    tables = [
        *(
            c.table(f"Relative orientation, median after 5 s, {text}", mean=True)
            for text, c in medians.items()
        ),
        squares.table(f"The same, RMSE after 5 s, {PLAIN}", mean=True),
        unaided.table(
            f"Median after 5 s without a heading from the reference, {PLAIN}", mean=True, text=UNAIDED
        ),
        forced.table(f"Orientations only, median after 5 s, {PLAIN}", mean=True, text=ORIENTATIONS),
        collected_limits.table("Limits of the reference", unit="", text=LIMITS_TEXT),
    ]
    return SetResult(FOLDER, TITLE, TEXT, tuple(tables), worst_of(plots))


def _run(
    folder: Path,
    name: str,
    medians: dict[str, Collected],
    squares: Collected,
    unaided: Collected,
    collected_limits: Collected,
) -> tuple[float, Plot | None]:
    """Fills the tables; gives the worst stretch."""
    recording, plain = read_openaxes(folder, name), read_openaxes_reference(folder, name)
    mounts = dict.fromkeys(LINKS, MOUNT)
    reference_limits = limits(recording, plain, mounts)
    collected_limits.put(name, reference_limits.figures)
    references = {PLAIN: plain, REMOVED: reference_limits.removed_from(plain)}
    rows = plain.time_s > SCORED_AFTER_S
    errors: dict[str, tuple[OrientationEstimate, Floats]] = {}
    for outcome in _outcomes(recording):
        for text, reference in references.items():
            if not isinstance(outcome, OrientationEstimate):
                medians[text].add(outcome, {})
                continue
            compared = punctual(recording, outcome, mounts) if text == REMOVED else outcome
            error = relative_error_rad(heading_zeroed(compared, reference, HEADING_AT_S), reference, PAIR)
            medians[text].add(outcome, {name: median_deg(error, rows)})
            if text == PLAIN and outcome.ours:
                unaided.add(outcome, {name: median_deg(relative_error_rad(outcome, reference, PAIR), rows)})
            if text == PLAIN:
                squares.add(outcome, {name: rmse_deg(error, rows)})
            errors[outcome.name] = outcome, np.degrees(error)  # those of the last reference stay
    angle = np.degrees(turn_between_rad(references[REMOVED], PAIR))
    caption = f"run {name}, {REMOVED}"
    truth = [("angle between the links, deg", angle)]
    return worst_plot(f"openaxes-{name}", caption, errors, references[REMOVED].time_s, rows, WINDOW_S, truth)


def _run_orientations(folder: Path, name: str, forced: Collected) -> None:
    recording, reference = read_openaxes(folder, name), read_openaxes_reference(folder, name)
    causal = others.VQF_WITHOUT_MAG[:1]
    plain_vqf = attempt(causal, lambda: others.vqf(recording, causal))
    rows = reference.time_s > SCORED_AFTER_S
    for units in plain_vqf:
        if not isinstance(units, OrientationEstimate):
            forced.add(units, {})
            continue
        links = heading_zeroed(next(_on_links(iter([units]))), reference, HEADING_AT_S)
        for outcome in orientations_only.estimates(units, links):
            scored = outcome if isinstance(outcome, OrientationEstimate) else None
            error = None if scored is None else relative_error_rad(scored, reference, PAIR)
            forced.add(outcome, {} if error is None else {name: median_deg(error, rows)})


def _outcomes(recording: Recording) -> list[Outcome]:
    return [
        *attempt(ours.NAMES, lambda: ours.track_openaxes(recording)),
        *attempt(ours.CALIBRATED_NAMES, lambda: ours.track_openaxes_calibrated(recording)),
        *attempt(others.VQF_WITHOUT_MAG, lambda: _on_links(others.vqf(recording, others.VQF_WITHOUT_MAG))),
        *attempt(
            others.IMUFUSION_WITHOUT_MAG,
            lambda: _on_links(others.imufusion(recording, others.IMUFUSION_WITHOUT_MAG)),
        ),
    ]


def _on_links(estimates: Iterator[OrientationEstimate]) -> Iterator[OrientationEstimate]:
    sensor_from_link = dict.fromkeys(LINKS, MOUNT.inv())
    return (estimate.rotated(sensor_from_link) for estimate in estimates)
