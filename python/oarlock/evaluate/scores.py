"""The results of an evaluation. SI and radians inside; degrees and millimetres in ``rows`` and ``table``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

NAN = float("nan")


def presentation(unit: str) -> tuple[float, str]:
    """Factor and name of the unit in which people read an error: rad -> deg, m -> mm."""
    return {"rad": (180 / math.pi, "deg"), "m": (1e3, "mm")}.get(unit, (1.0, unit))


@dataclass(frozen=True)
class JointScore:
    """One joint against truth. ``rmse``, ``bias`` (mean error) and ``mean_std`` are in ``unit`` (rad or m).

    ``coverage`` is the share of samples with |error| <= 1.96 std; ``nees`` is the mean of (error / std)^2, 1 for
    a consistent filter (Bar-Shalom et al. 2001, section 5.4); ``correlation`` is NaN where either signal is
    constant. Not scored (``observed`` False): all numbers are NaN and ``note`` says why.
    """

    name: str
    unit: str
    observed: bool
    note: str
    samples: int
    rmse: float
    bias: float
    correlation: float
    coverage: float
    nees: float
    mean_std: float

    @classmethod
    def unscored(cls, name: str, unit: str, note: str) -> JointScore:
        """A joint that cannot be scored, and why."""
        return cls(name, unit, False, note, 0, NAN, NAN, NAN, NAN, NAN, NAN)

    @property
    def row(self) -> dict[str, Any]:
        """The score in deg or mm, coverage in percent."""
        factor, unit = presentation(self.unit)
        constant = "constant" if self.observed and math.isnan(self.correlation) else ""
        return {
            "joint": self.name,
            "unit": unit,
            "rmse": self.rmse * factor,
            "bias": self.bias * factor,
            "correlation": self.correlation,
            "coverage_percent": self.coverage * 100,
            "nees": self.nees,
            "mean_std": self.mean_std * factor,
            "note": self.note or constant,
        }

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, SI, unit in the key; None where there is no number."""
        return {
            "unit": self.unit,
            "observed": self.observed,
            "note": self.row["note"],
            "samples": self.samples,
            f"rmse_{self.unit}": _number(self.rmse),
            f"bias_{self.unit}": _number(self.bias),
            f"mean_std_{self.unit}": _number(self.mean_std),
            "correlation": _number(self.correlation),
            "coverage_95": _number(self.coverage),
            "nees": _number(self.nees),
        }


@dataclass(frozen=True)
class PositionScore:
    """One frame's origin in root axes against truth: 3D and per axis, m; correlation NaN where constant."""

    frame: str
    samples: int
    rmse_m: float
    axis_rmse_m: tuple[float, float, float]
    axis_correlation: tuple[float, float, float]

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, SI."""
        return {
            "samples": self.samples,
            "rmse_m": _number(self.rmse_m),
            "axis_rmse_m": [_number(v) for v in self.axis_rmse_m],
            "axis_correlation": [_number(v) for v in self.axis_correlation],
        }


@dataclass(frozen=True)
class StateScore:
    """NEES per state over the beliefs (Bar-Shalom et al. 2001, section 5.4): 1 is expected.

    ``interval_95`` holds it 95 % of the time for independent beliefs. ``degrees`` counts states times
    beliefs; ``singular`` counts beliefs left out because their covariance is not positive definite.
    """

    nees: float
    interval_95: tuple[float, float]
    beliefs: int
    degrees: int
    singular: int

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe."""
        return {
            "nees_per_state": _number(self.nees),
            "interval_95": [_number(v) for v in self.interval_95],
            "beliefs": self.beliefs,
            "degrees": self.degrees,
            "singular": self.singular,
        }


@dataclass(frozen=True)
class SensorScore:
    """NIS per measurement of one sensor or closure, and its rows; 1 is expected.

    `joint` marks a score over several sensors, whose rows are counted with these. Source: Bar-Shalom et al. 2001,
    section 5.4.
    """

    name: str
    nis: float
    interval_95: tuple[float, float]
    used: int
    rejected: int
    missing: int
    joint: bool = False

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe."""
        return {
            "nis_per_measurement": _number(self.nis),
            "interval_95": [_number(v) for v in self.interval_95],
            "used": self.used,
            "rejected": self.rejected,
            "missing": self.missing,
        }


@dataclass(frozen=True)
class Evaluation:
    """A track against truth: ``joints`` in model order, frame ``positions``, ``states``, ``sensors``.

    ``reference`` names what it was held against; anything but "truth" has errors of its own.

    ``states`` is None without beliefs. ``samples`` is the number of the track's samples after ``start_s``
    (s after its first stamp).
    """

    joints: tuple[JointScore, ...]
    positions: tuple[PositionScore, ...]
    states: StateScore | None
    sensors: tuple[SensorScore, ...]
    start_s: float
    samples: int
    reference: str = "truth"

    def __getitem__(self, joint: str) -> JointScore:
        for score in self.joints:
            if score.name == joint:
                return score
        raise KeyError(
            f"no joint {joint!r} was evaluated; there are {', '.join(s.name for s in self.joints)}"
        )

    @property
    def rows(self) -> tuple[dict[str, Any], ...]:
        """One row per joint in deg or mm, coverage in percent."""
        return tuple(score.row for score in self.joints)

    def hinges(self, names: Sequence[str] | None = None) -> tuple[JointScore, ...]:
        """The hinges among ``names``, scored or not; default all scored ones."""
        chosen = self.joints if names is None else tuple(self[name] for name in names)
        return tuple(
            score for score in chosen if score.unit == "rad" and (score.observed or names is not None)
        )

    def mean_rmse_deg(self, names: Sequence[str] | None = None) -> float:
        """Mean over hinges of their RMSE, deg; default all scored ones. NaN if one of ``names`` is not scored."""
        return _mean_of([math.degrees(score.rmse) for score in self.hinges(names)])

    def worst_rmse_deg(self, names: Sequence[str] | None = None) -> float:
        """Largest RMSE among hinges, deg; as ``mean_rmse_deg``."""
        errors = [math.degrees(score.rmse) for score in self.hinges(names)]
        return float(np.max(errors)) if errors else NAN

    def mean_coverage(self, names: Sequence[str] | None = None) -> float:
        """Mean over hinges of the share of samples inside the 95 % band; those without a band are left out."""
        shares = [score.coverage for score in self.hinges(names)]
        return _mean_of([share for share in shares if not math.isnan(share)])

    def table(self) -> list[list[str]]:
        """The joints as text, first row the header; deg and mm."""
        header = [
            "joint",
            "unit",
            "RMSE",
            "mean error",
            "correlation",
            "in 95 % band",
            "NEES",
            "mean std",
            "note",
        ]
        return [header, *(_text_row(row) for row in self.rows)]

    def __str__(self) -> str:
        """The table, aligned."""
        rows = self.table()
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        return "\n".join(
            "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe: SI, None where there is no number; the means over all scored hinges in deg."""
        return {
            "reference": self.reference,
            "start_s": self.start_s,
            "samples": self.samples,
            "mean_rmse_deg": _number(self.mean_rmse_deg()),
            "worst_rmse_deg": _number(self.worst_rmse_deg()),
            "mean_coverage_95": _number(self.mean_coverage()),
            "joints": {score.name: score.to_dict() for score in self.joints},
            "positions": {score.frame: score.to_dict() for score in self.positions},
            "states": self.states.to_dict() if self.states else None,
            "sensors": {score.name: score.to_dict() for score in self.sensors},
        }


def _text_row(row: dict[str, Any]) -> list[str]:
    formats = {
        "rmse": "#.3g",
        "bias": "+.2g",
        "correlation": ".4f",
        "coverage_percent": ".1f",
        "nees": ".2f",
        "mean_std": "#.3g",
    }
    numbers = [f"{row[key]:{style}}" if math.isfinite(row[key]) else "-" for key, style in formats.items()]
    return [row["joint"], row["unit"], *numbers, row["note"]]


def _mean_of(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else NAN


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
