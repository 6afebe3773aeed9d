"""Strokes for the live page: its columns, and each stroke as a message as soon as the next one begins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from oarlock import Belief, Calibration, Model
from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.analysis.live_technique import LiveTechnique, StrokeEstimates, live_stroke

SHOWN = (
    "rate_per_min",
    "drive_time_s",
    "rhythm",
    "arc_rad",
    "catch_angle_rad",
    "finish_angle_rad",
    "catch_lean_rad",
    "finish_lean_rad",
    "r_arm_plane_rad",
    "l_arm_plane_rad",
    "handle_travel_m",
)
"""Columns of `oarlock.rowing.technique` that the page shows, in this order."""


@dataclass
class StrokeFollower:
    """Makes messages of the strokes in a live session's estimates.

    Args:
        model: of the rower.
    """

    model: Model
    work: Callable[[Any, Calibration | None], Mapping[str, Any] | None] = field(init=False)
    """Computes a message of what `step` returned, with the calibration that serves; it runs in another process."""

    def __post_init__(self) -> None:
        self._technique = LiveTechnique(self.model)
        self.work = partial(stroke_message, self.model)

    @property
    def columns(self) -> list[dict[str, Any]]:
        """What the page shows of a stroke."""
        return [
            {"key": name, "label": FEATURES[name].label, "unit": FEATURES[name].shown_unit} for name in SHOWN
        ]

    def step(self, time_s: float, belief: Belief) -> StrokeEstimates | None:
        """What `work` makes a message of, when a stroke has ended."""
        return self._technique.step(time_s, belief)


def stroke_message(
    model: Model, stretch: StrokeEstimates, calibration: Calibration | None
) -> dict[str, Any] | None:
    """A stroke as the page gets it, in the units that people read."""
    stroke = live_stroke(stretch, model, calibration)
    if stroke is None:
        return None
    values = {}
    for name in SHOWN:
        if name in stroke.values:
            scale = FEATURES[name].shown_scale
            value, std = stroke.values[name]
            values[name] = {"value": round(scale * value, 4), "std": round(scale * std, 4)}
    return {"type": "stroke", "time_s": round(stroke.time_s, 3), "values": values}
