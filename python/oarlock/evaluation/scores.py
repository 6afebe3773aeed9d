"""Result classes of an evaluation: SI and radians in the fields, degrees and millimetres in ``rows`` and ``table``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.storage.dataframes import columns_of_rows, pandas_table, polars_table
from oarlock.storage.notebook_html import card, folded, html_table
from oarlock.tracking.counts import StreamCount

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

NAN = float("nan")


def presentation(unit: str) -> tuple[float, str]:
    """Factor and name of the displayed unit of an error: rad -> deg, m -> mm."""
    return {"rad": (180 / math.pi, "deg"), "m": (1e3, "mm")}.get(unit, (1.0, unit))


@dataclass(frozen=True)
class JointScore:
    """Scores of one joint. ``rmse``, ``bias`` (mean error) and ``mean_std`` are in ``unit`` (rad or m).

    ``coverage`` is the share of samples with |error| <= 1.96 std; ``nees`` is the mean of (error / std)^2, 1 for
    a consistent filter (Bar-Shalom et al. 2001, section 5.4); ``correlation`` is NaN where either signal is
    constant. A joint that is not scored has ``observed`` False, NaN in all numbers, and the reason in ``note``.

    The error of a ball joint, and of position and rotation of a free joint (`pelvis.position`, `pelvis.rotation`), has
    three components. For a rotation it is -e with e = Log(R_est' R_true), in the child's axes. Then ``rmse`` is that of
    its length, for a rotation the angle between estimate and truth; ``bias`` is the length of its mean, ``mean_std``
    that of the standard deviations; ``coverage`` and ``nees`` are means over the three. ``correlation`` treats the
    three components, minus their means, as one signal: the position, or the rotation vector relative to the truth's
    mean posture, which has no singularity. ``parts`` has a score of each component, and of each named angle.
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
    parts: tuple[JointScore, ...] = ()

    @classmethod
    def unscored(cls, name: str, unit: str, note: str) -> JointScore:
        """The score of a joint that cannot be scored; `note` gives the reason."""
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
        """JSON-safe, SI, unit in the key; None where there is no number; parts by name, if there are any."""
        parts = {"parts": {part.name: part.to_dict() for part in self.parts}} if self.parts else {}
        return {
            "unit": self.unit,
            "observed": self.observed,
            "note": self.row["note"],
            "samples": self.samples,
            f"rmse_{self.unit}": json_number(self.rmse),
            f"bias_{self.unit}": json_number(self.bias),
            f"mean_std_{self.unit}": json_number(self.mean_std),
            "correlation": json_number(self.correlation),
            "coverage_95": json_number(self.coverage),
            "nees": json_number(self.nees),
            **parts,
        }


@dataclass(frozen=True)
class PositionScore:
    """Position errors of one frame's origin in root axes: 3D and per axis, m; correlation is NaN if constant.

    ``coverage`` is the share of single axes with |error| <= 1.96 std; NaN if the track has no standard deviations.
    """

    frame: str
    samples: int
    rmse_m: float
    axis_rmse_m: tuple[float, float, float]
    axis_correlation: tuple[float, float, float]
    coverage: float

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe, SI."""
        names = {"coverage": "coverage_95"}
        return {names.get(name, name): plain(value) for name, value in vars(self).items() if name != "frame"}


@dataclass(frozen=True)
class StateScore:
    """NEES per state over the beliefs (Bar-Shalom et al. 2001, section 5.4): 1 is expected.

    ``interval_95`` is its 95 % interval if the beliefs are independent. ``degrees`` is the number of states times
    beliefs; ``singular`` is the number of beliefs that were left out because their covariance is not positive definite.
    """

    nees: float
    interval_95: tuple[float, float]
    beliefs: int
    degrees: int
    singular: int

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe."""
        return {
            "nees_per_state" if name == "nees" else name: plain(value) for name, value in vars(self).items()
        }


@dataclass(frozen=True)
class SensorScore:
    """NIS per reading of one sensor or closure, 1 is expected, and the counts of its stream over the whole recording.

    ``count`` is None for a closure and for several sensors together, which have no stream of their own; the NIS of an
    encoder whose readings are inputs is NaN. Source: Bar-Shalom et al. 2001, section 5.4.
    """

    name: str
    nis: float
    interval_95: tuple[float, float]
    count: StreamCount | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe."""
        own = {"nis_per_measurement": plain(self.nis), "interval_95": plain(self.interval_95)}
        if self.count is None:
            return own
        counted = self.count.to_dict() | {"missing": self.count.missing, "unused": self.count.unused}
        return own | {name: plain(value) for name, value in counted.items()}


@dataclass(frozen=True)
class Evaluation:
    """Scores of a track against ground truth: ``joints`` in model order, frame ``positions``, ``states``, ``sensors``.

    A free joint has two entries in ``joints``: `pelvis.position` and `pelvis.rotation`.

    ``reference`` names the reference; any reference other than "truth" has errors of its own.

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
        """One row per joint in deg or mm, coverage in percent; position and rotation of a free joint have one each."""
        return tuple(score.row for score in self.joints)

    @property
    def part_rows(self) -> tuple[dict[str, Any], ...]:
        """As ``rows``, one per component and per named angle of ball and free joints."""
        return tuple(part.row for score in self.joints for part in score.parts)

    def turning(self, names: Sequence[str] | None = None) -> tuple[JointScore, ...]:
        """The rotational joints among ``names``, scored or not: hinges, balls, rotations of free joints.

        Default: all scored ones.
        """
        chosen = self.joints if names is None else tuple(self[name] for name in names)
        return tuple(
            score for score in chosen if score.unit == "rad" and (score.observed or names is not None)
        )

    def hinges(self, names: Sequence[str] | None = None) -> tuple[JointScore, ...]:
        """The hinges among ``names``, scored or not; default all scored ones."""
        return tuple(score for score in self.turning(names) if not score.parts)

    def mean_rmse_deg(self, names: Sequence[str] | None = None) -> float:
        """Mean RMSE of the rotational joints, deg; for a ball joint that of the whole angle.

        Default: all scored ones. NaN if one of ``names`` is not scored.
        """
        return _mean_of([math.degrees(score.rmse) for score in self.turning(names)])

    def worst_rmse_deg(self, names: Sequence[str] | None = None) -> float:
        """Largest RMSE of the rotational joints, deg; see ``mean_rmse_deg``."""
        errors = [math.degrees(score.rmse) for score in self.turning(names)]
        return float(np.max(errors)) if errors else NAN

    def mean_coverage(self, names: Sequence[str] | None = None) -> float:
        """Mean coverage of the 95 % bands over the rotational joints; those without a band are left out."""
        shares = [score.coverage for score in self.turning(names)]
        return _mean_of([share for share in shares if not math.isnan(share)])

    def table(self, parts: bool = False) -> list[list[str]]:
        """The joints as text, first row the header; deg and mm. ``parts``: components and named angles instead."""
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
        return [header, *(_text_row(row) for row in (self.part_rows if parts else self.rows))]

    def to_pandas(self) -> pd.DataFrame:
        """`rows` as a pandas DataFrame (needs the extra `oarlock[dataframe]`)."""
        return pandas_table(columns_of_rows(self.rows))

    def to_polars(self) -> pl.DataFrame:
        """`rows` as a polars DataFrame (needs the extra `oarlock[polars]`)."""
        return polars_table(columns_of_rows(self.rows))

    def _repr_html_(self) -> str:
        header, *rows = self.table()
        facts = f"{self.samples} samples after {self.start_s:g} s, against {self.reference}"
        mean = f"mean RMSE {self.mean_rmse_deg():.2f} deg" if self.turning() else ""
        positions = html_table(
            ["frame", "RMSE, mm"], [(score.frame, f"{1e3 * score.rmse_m:.1f}") for score in self.positions]
        )
        sensors = html_table(["sensor", "NIS"], [(score.name, score.nis) for score in self.sensors])
        return card(
            "Evaluation",
            ", ".join(part for part in (facts, mean) if part),
            html_table(header, rows),
            folded(f"{len(self.positions)} positions", positions if self.positions else ""),
            folded(f"{len(self.sensors)} sensors; NIS per reading, 1 is expected", sensors),
        )

    def __str__(self) -> str:
        """The tables, aligned."""
        joints, components = aligned(self.table()), aligned(self.table(parts=True))
        return f"{joints}\n\n{components}" if self.part_rows else joints

    def to_dict(self) -> dict[str, Any]:
        """JSON-safe: SI, None where there is no number; means over all scored rotational joints, in deg."""
        return {
            "reference": self.reference,
            "start_s": self.start_s,
            "samples": self.samples,
            "mean_rmse_deg": json_number(self.mean_rmse_deg()),
            "worst_rmse_deg": json_number(self.worst_rmse_deg()),
            "mean_coverage_95": json_number(self.mean_coverage()),
            "joints": {score.name: score.to_dict() for score in self.joints},
            "positions": {score.frame: score.to_dict() for score in self.positions},
            "states": self.states.to_dict() if self.states else None,
            "sensors": {score.name: score.to_dict() for score in self.sensors},
        }


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Rows of cells as lines with aligned columns."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows
    )


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


def plain(value: Any) -> Any:
    """Numbers, lists and tables of them for JSON; None where there is no number."""
    if isinstance(value, float):
        return json_number(value)
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    return [plain(float(one)) for one in value] if isinstance(value, tuple | np.ndarray) else value


def json_number(value: float) -> float | None:
    """None where there is no number: JSON has no NaN."""
    return float(value) if math.isfinite(value) else None
