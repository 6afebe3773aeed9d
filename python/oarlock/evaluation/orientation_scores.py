"""The results of comparing orientations of frames. Radians inside; degrees in ``rows`` and ``table``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from oarlock.evaluation.scores import aligned, json_number


@dataclass(frozen=True)
class OrientationScore:
    """One frame: RMSE and largest value of the whole error angle, RMSE of its inclination and heading, rad.

    For an error quaternion (w, v) in world axes, with z the component of v along the vertical, the angle is
    2 arccos |w|, the heading error 2 arctan |z / w|, the inclination error 2 arccos sqrt(w^2 + z^2). NaN: no common
    sample, or an orientation relative to another frame, which has neither inclination nor heading.
    """

    frame: str
    samples: int
    rmse_rad: float
    inclination_rmse_rad: float
    heading_rmse_rad: float
    worst_rad: float

    @property
    def row(self) -> dict[str, Any]:
        """The score in degrees."""
        return {
            "frame": self.frame,
            "samples": self.samples,
            "rmse_deg": math.degrees(self.rmse_rad),
            "inclination_rmse_deg": math.degrees(self.inclination_rmse_rad),
            "heading_rmse_deg": math.degrees(self.heading_rmse_rad),
            "worst_deg": math.degrees(self.worst_rad),
        }

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, rad; None where there is no number."""
        names = ("rmse_rad", "inclination_rmse_rad", "heading_rmse_rad", "worst_rad")
        return {"samples": self.samples} | {name: json_number(getattr(self, name)) for name in names}


@dataclass(frozen=True)
class OrientationEvaluation:
    """Orientations of ``frames`` in the axes of the root, or of ``relative_to``.

    ``removed_heading_rad`` is the angle about the vertical that was removed from the track, None if none was.
    ``samples`` is the number of scored samples of the track; ``reference`` names the reference.
    """

    frames: tuple[OrientationScore, ...]
    relative_to: str | None
    removed_heading_rad: float | None
    start_s: float
    samples: int
    reference: str = "truth"

    def __getitem__(self, frame: str) -> OrientationScore:
        for score in self.frames:
            if score.frame == frame:
                return score
        raise KeyError(
            f"no frame {frame!r} was evaluated; there are {', '.join(s.frame for s in self.frames)}"
        )

    @property
    def rows(self) -> tuple[dict[str, Any], ...]:
        """One row per frame in degrees."""
        return tuple(score.row for score in self.frames)

    def mean_rmse_deg(self) -> float:
        """Mean RMSE over the frames, deg; NaN if one has no common sample."""
        return math.degrees(float(np.mean([score.rmse_rad for score in self.frames])))

    def table(self) -> list[list[str]]:
        """The frames as text, degrees, first row the header."""
        header = ["frame", "RMSE deg", "inclination deg", "heading deg", "worst deg"]
        keys = ("rmse_deg", "inclination_rmse_deg", "heading_rmse_deg", "worst_deg")
        shown = [
            [f"{row[key]:#.3g}" if math.isfinite(row[key]) else "-" for key in keys] for row in self.rows
        ]
        return [header, *([row["frame"], *cells] for row, cells in zip(self.rows, shown, strict=True))]

    def __str__(self) -> str:
        """The table, aligned."""
        return aligned(self.table())

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, SI."""
        heading = self.removed_heading_rad
        return {
            "reference": self.reference,
            "relative_to": self.relative_to,
            "removed_heading_rad": None if heading is None else json_number(heading),
            "start_s": self.start_s,
            "samples": self.samples,
            "mean_rmse_deg": json_number(self.mean_rmse_deg()),
            "frames": {score.frame: score.to_dict() for score in self.frames},
        }
