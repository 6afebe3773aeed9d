"""`MarkerEvaluation` and `PointScore`: the result of `evaluate_markers`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from oarlock.evaluation.scores import aligned, json_number, plain
from oarlock.storage.arrays import Floats


@dataclass(frozen=True, eq=False)
class PointScore:
    """Scores of one point of the track relative to its marker.

    Args:
        frame: the model's frame that carries the point.
        samples: number of samples of the track that were compared.
        rmse_m: (3,) root mean square error along x, y, z of the reference frame, m.
        rmse_3d_m: root mean square distance, m.
        correlation: (3,) along x, y, z; NaN where either is constant.
        correlation_3d: of the three coordinates as one signal, each less its mean.
        mean_error_m: (3,) track minus marker, m.
    """

    frame: str
    samples: int
    rmse_m: Floats
    rmse_3d_m: float
    correlation: Floats
    correlation_3d: float
    mean_error_m: Floats

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, SI; None where there is no number."""
        return {name: plain(value) for name, value in vars(self).items()}


@dataclass(frozen=True, eq=False)
class MarkerEvaluation:
    """Scores of a track relative to optical markers.

    Args:
        points: by marker.
        clock_offset_s: offset that is added to the markers' time stamps to match the track's clock, s; 0 if not
            aligned.
        clock_drift: relative rate by which the track's clock is faster; 0 if not estimated.
        track_from_markers: (4, 4) pose of the measuring system in the track's reference frame; the identity if not
            aligned.
        relative_to: the track's frame in whose axes positions are compared.
        start_s: time after the track's first time stamp that was not scored, s.
        notes: notes on the alignment.
    """

    points: Mapping[str, PointScore]
    clock_offset_s: float
    clock_drift: float
    track_from_markers: Floats
    relative_to: str
    start_s: float
    notes: tuple[str, ...] = ()

    @property
    def mean_rmse_3d_m(self) -> float:
        """Mean over the points of their RMSE, m."""
        return sum(score.rmse_3d_m for score in self.points.values()) / len(self.points)

    def table(self) -> list[list[str]]:
        """The points as text in mm, first row the header."""
        header = ["marker", "frame", "samples", "RMSE mm", "x", "y", "z", "r", "r x", "r y", "r z"]
        rows = [header]
        for marker, score in self.points.items():
            mm = [f"{1e3 * v:.1f}" for v in (score.rmse_3d_m, *score.rmse_m)]
            r = [f"{v:.4f}" for v in (score.correlation_3d, *score.correlation)]
            rows.append([marker, score.frame, str(score.samples), *mm, *r])
        return rows

    def __str__(self) -> str:
        """The table, aligned."""
        return aligned(self.table())

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, SI; None where there is no number."""
        return {
            "relative_to": self.relative_to,
            "start_s": self.start_s,
            "clock_offset_s": self.clock_offset_s,
            "clock_drift": self.clock_drift,
            "track_from_markers": self.track_from_markers.tolist(),
            "mean_rmse_3d_m": json_number(self.mean_rmse_3d_m),
            "points": {marker: score.to_dict() for marker, score in self.points.items()},
            "notes": list(self.notes),
        }
