"""`Reference`: orientations of bodies from another measuring system (cameras, encoders), to score tracks against."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from oarlock.storage.array_gate import real_array, time_array
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

LARGEST_NORM_ERROR = 0.01
"""Largest deviation of a quaternion's norm from 1. A larger one means another quantity or a wrong column."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Orientations of bodies over time from another measuring system with its own clock.

    Args:
        source: name of the measuring system in tables and reports: "optical", "encoders".
        time_s: (T,) strictly increasing stamps in s.
        quat_wxyz: body -> (T, 4) world_from_body, world with z up; a row of NaN in a gap. Stored with norm 1.
        position_m: body -> (T, 3) position of a point fixed to the body, in world axes, m; NaN in a gap. May be empty.
        scored: (T,) whether a sample counts in a comparison; all samples if empty. A gap never counts.

    Raises:
        DataError: no body, time stamps out of order, a wrong shape, a norm that is not 1, or a quaternion with missing
            components.
    """

    source: str
    time_s: Floats
    quat_wxyz: Mapping[str, Floats]
    position_m: Mapping[str, Floats] = field(default_factory=dict)
    scored: Bools = field(default_factory=lambda: np.ones(0, dtype=np.bool_))

    def __post_init__(self) -> None:
        time_s = time_array(self.time_s, f"{self.source} reference, time_s")
        object.__setattr__(self, "time_s", time_s)
        if not self.quat_wxyz:
            raise DataError(f"{self.source} reference: has no body")
        quats = {
            b: _unit(self._rows("orientation", b, q, 4), self._where(b)) for b, q in self.quat_wxyz.items()
        }
        points = {b: self._rows("position", b, p, 3) for b, p in self.position_m.items()}
        object.__setattr__(self, "quat_wxyz", MappingProxyType(quats))
        object.__setattr__(self, "position_m", MappingProxyType(points))
        object.__setattr__(self, "scored", self._scored())

    def _where(self, body: str) -> str:
        return f'{self.source} reference of "{body}"'

    def _rows(self, quantity: str, body: str, values: Floats, width: int) -> Floats:
        where = f"{self._where(body)}, {quantity}"
        rows = real_array(values, (None, width), where)
        if len(rows) != len(self.time_s):
            raise DataError(f"{where}: has {len(rows)} rows, but time_s has {len(self.time_s)}")
        return rows

    def _scored(self) -> Bools:
        size = len(self.time_s)
        scored = np.array(self.scored, dtype=np.bool_) if len(self.scored) else np.ones(size, dtype=np.bool_)
        if scored.shape != (size,):
            raise DataError(f"{self.source} reference, scored: has shape {scored.shape}, expected ({size},)")
        scored.setflags(write=False)
        return scored

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, in the order of the file."""
        return tuple(self.quat_wxyz)

    @property
    def rate_hz(self) -> float:
        """Sample rate in Hz: one over the median step; NaN for a single sample."""
        return 1.0 / float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else float("nan")

    def there(self, *bodies: str) -> Bools:
        """(T,) where all of these bodies have an orientation; without names, all bodies."""
        there = np.ones(len(self.time_s), dtype=np.bool_)
        for body in bodies or self.bodies:
            there &= np.isfinite(self.quat_wxyz[body]).all(axis=1)
        return there


def _unit(quat_wxyz: Floats, where: str) -> Floats:
    with np.errstate(over="ignore"):  # an infinite or NaN norm is not 1 either
        norms = np.linalg.norm(quat_wxyz, axis=1)
    gap = np.isnan(quat_wxyz).all(axis=1)
    halves = np.flatnonzero(np.isnan(norms) & ~gap)
    if halves.size:
        raise DataError(f"{where}: row {halves[0]} lacks part of its quaternion ({halves.size} rows do)")
    wrong = np.flatnonzero(np.abs(norms - 1.0) > LARGEST_NORM_ERROR)
    if wrong.size:
        raise DataError(
            f"{where}: row {wrong[0]} has a quaternion of norm {norms[wrong[0]]:.4f} ({wrong.size} rows are not "
            "of norm 1). Are these the columns w, x, y, z?"
        )
    unit: Floats = quat_wxyz / norms[:, None]
    unit.setflags(write=False)
    return unit
