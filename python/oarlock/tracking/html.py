"""A track as notebooks show it (`Track._repr_html_`): what it is, its joints with their bands, its notes."""

from __future__ import annotations

import numpy as np

from oarlock.recording.session_info import session_info, session_text
from oarlock.storage.arrays import Floats
from oarlock.storage.notebook_html import card, folded, html_list, html_table
from oarlock.storage.statistics import NORMAL_95
from oarlock.tracking.estimates import Estimates

_DEG = float(np.degrees(1.0))


def track_html(track: Estimates) -> str:
    """HTML of a track."""
    kind = "smoothed" if track.smoothed else "filtered" if track.info else "ground truth or reference"
    model = track.model.name if track.model is not None else "no model"
    facts = [model, kind, session_text(session_info(track.provenance))]
    if len(track.time_s):
        facts.insert(1, f"{len(track.time_s)} samples, {track.time_s[0]:.2f} to {track.time_s[-1]:.2f} s")
    table = html_table(
        ["coordinate", "unit", "smallest", "median", "largest", "95 % band ±", "observed %"],
        [_row(track, column) for column in range(len(track.coordinate_names))],
    )
    notes = folded(f"Notes ({len(track.notes)})", html_list(track.notes)) if track.notes else ""
    return card(
        "Track", ", ".join(fact for fact in facts if fact), folded("Joints", table, is_open=True), notes
    )


def _row(track: Estimates, column: int) -> list[object]:
    unit = track.coordinate_units[column]
    factor, shown = (_DEG, "deg") if unit == "rad" else (100.0, "cm")
    value, std = factor * track.q[:, column], factor * track.q_std[:, column]
    seen = track.observed[:, column]
    figures: list[object] = [None, None, None, None]
    if seen.any() and np.isfinite(value).any():
        figures[:3] = [f"{x:.1f}" for x in np.nanpercentile(value, [0, 50, 100])]
        figures[3] = _band(std)
    return [
        track.coordinate_names[column],
        shown,
        *figures,
        f"{100.0 * seen.mean():.0f}" if len(seen) else None,
    ]


def _band(std: Floats) -> str | None:
    known = std[np.isfinite(std)]
    return f"{NORMAL_95 * float(np.median(known)):.2f}" if known.size else None
