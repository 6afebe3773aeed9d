"""A chain of five links (free, ball, hinges about x, y, z) against optical segments: units screwed on or on foam."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from oarlock import Recording
from oarlock.evaluation.reference import Reference
from oarlock.formats.datasets.diodem import Mounted, read_diodem, read_diodem_reference

from . import chains, others, ours
from .chains import Link
from .estimate import OrientationEstimate, Outcome, attempt
from .limits import limits, punctual
from .results import Collected, Panel, Plot, SetResult
from .scores import hinge_error_rad, later, relative_error_rad, rmse_deg
from .worst_window import Errors, curves, worst_window

FOLDER = "diodem_arm"
TRIAL = "trial1"
SCORED_AFTER_S = 5.0
WINDOW_S = 8.0

TRIAL1_LAG_S = 0.015
"""How late the cameras' stamps are in this trial, as readers of the data found; `limits` finds nearly the same."""

MAG_UNIT_UT = 49.0
"""The magnetometers' arbitrary unit is about the Earth's field. No software that runs here depends on the scale."""

HINGES = {
    "hinge x": (("seg2", "seg3"), "x"),
    "hinge y": (("seg3", "seg4"), "y"),
    "hinge z": (("seg4", "seg5"), "z"),
}
BALL = ("seg1", "seg2")
MOUNTED: tuple[Mounted, ...] = ("rigid", "foam")

CHAIN_SOURCES = ("VQF 6D", "VQF 9D")

# Root and ball joint are three hinges each; their sequence has no meaning.
CHAIN = (Link("seg1", "xyz"), Link("seg2", "xyz"), Link("seg3", "x"), Link("seg4", "y"), Link("seg5", "z"))

TITLE = "Chain of five links (DIODEM)"
TEXT = (
    "Five links: the first free, then a ball joint and hinges about x, y and z; on each a 9-axis unit "
    "screwed on and one on foam, 40 Hz. The reference is optical, 30 Hz, 15 ms late in this trial, with "
    "gaps. Scored after 5 s, root mean square: the hinge angles (the twists of the segments' relative "
    "orientations about the hinge's axis) and the whole relative orientation at the ball joint. VQF 6D "
    "has no common heading; the hinges suffer from that in part, the ball joint fully. Skin: the units may turn "
    "by 5 deg on their links."
)
PLAIN, REMOVED = "as it stands", "limits and delays removed"
LIMITS_TEXT = (
    "How late the optical stamps are beyond the 15 ms that are known, and how far each unit is turned against its "
    "optical segment on average: under the foam-mounted units that is the mounting itself, which no software knew. "
    "Rows with skin estimate it, so for them the reference as it stands is the right one."
)


def run(data_folder: Path) -> SetResult:
    """Score the trial with both kinds of mounting."""
    folder = data_folder / FOLDER / TRIAL
    if not (folder / "omc.csv").is_file():
        return SetResult(FOLDER, TITLE, TEXT, absent=f"no {FOLDER}/{TRIAL}/omc.csv")
    plain = later(read_diodem_reference(folder), TRIAL1_LAG_S)
    tables, plots, collected_limits = [], [], Collected()
    for mounted in MOUNTED:
        recording = read_diodem(folder, mounted, MAG_UNIT_UT)
        reference_limits = limits(recording, plain)
        collected_limits.put(mounted, reference_limits.figures)
        removed = reference_limits.removed_from(plain)
        outcomes = _outcomes(recording, mounted)
        exact = [punctual(recording, o) if isinstance(o, OrientationEstimate) else o for o in outcomes]
        for text, compared, reference in ((PLAIN, outcomes, plain), (REMOVED, exact, removed)):
            collected = Collected()
            for outcome in compared:
                collected.add(outcome, _figures(outcome, reference))
            tables.append(collected.table(f"{mounted.capitalize()} units, RMSE after 5 s, {text}"))
        plots.append(_plot(mounted, exact, removed))
    tables.append(collected_limits.table("Limits of the reference", unit="", text=LIMITS_TEXT))
    return SetResult(FOLDER, TITLE, TEXT, tuple(tables), tuple(p for p in plots if p is not None))


def _outcomes(recording: Recording, mounted: Mounted) -> list[Outcome]:
    outcomes = attempt(ours.NAMES, lambda: ours.track_diodem(recording))
    outcomes += attempt(ours.CALIBRATED_NAMES, lambda: ours.track_diodem_calibrated(recording, mounted))
    if mounted == "foam":
        outcomes += attempt(ours.SKIN_NAMES, lambda: ours.track_diodem_skin(recording))
    singles = attempt(others.VQF_NAMES, lambda: others.vqf(recording))
    outcomes += singles
    outcomes += attempt(others.IMUFUSION_NAMES, lambda: others.imufusion(recording))
    for source in singles:
        if isinstance(source, OrientationEstimate) and source.name in CHAIN_SOURCES:
            outcomes += [outcome for outcome, _ in chains.on_chain(source, CHAIN)]
    return outcomes


def _figures(outcome: Outcome, reference: Reference) -> dict[str, float]:
    if not isinstance(outcome, OrientationEstimate):
        return {}
    rows = reference.time_s > SCORED_AFTER_S
    figures = {
        name: rmse_deg(hinge_error_rad(outcome, reference, pair, axis), rows)
        for name, (pair, axis) in HINGES.items()
        if set(pair) <= set(outcome.quats)
    }
    if set(BALL) <= set(outcome.quats):
        figures["ball joint"] = rmse_deg(relative_error_rad(outcome, reference, BALL), rows)
    return figures


def _plot(mounted: str, outcomes: list[Outcome], reference: Reference) -> Plot | None:
    """All hinges in the stretch that is worst for the first of them."""
    estimates = [o for o in outcomes if isinstance(o, OrientationEstimate)]
    if not estimates:
        return None
    scored_rows = reference.time_s > SCORED_AFTER_S
    panels: list[Panel] = []
    window = None
    for name, (pair, axis) in HINGES.items():
        errors: Errors = {
            e.name: (e, np.degrees(hinge_error_rad(e, reference, pair, axis)))
            for e in estimates
            if set(pair) <= set(e.quats)
        }
        window = window or worst_window(errors, reference.time_s, scored_rows, WINDOW_S)
        panels.append((f"{name}, error, deg", curves(errors, reference.time_s, window)))
    when = window.text if window else ""
    title = f"Worst {WINDOW_S:.0f} s of hinge x: {mounted} units, {REMOVED}, {when}"
    return Plot(f"diodem-{mounted}", title, tuple(panels))
