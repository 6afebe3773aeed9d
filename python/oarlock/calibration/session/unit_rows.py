"""`UnitRows`: complete readings of one inertial unit and its intervals at rest, for the searches of a session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats, Indices

Span = tuple[float, float]

WINDOW_S = 0.25
LYING_GYRO_RAD_S = 0.03
WORN_GYRO_RAD_S = 0.1
LYING_ACCEL_M_S2 = 0.15
WORN_ACCEL_M_S2 = 0.4
NOISE_FACTOR = 2.0
"""A window is still up to this many times the scatter of the calmest ones, however noisy the unit."""


@dataclass(frozen=True, eq=False)
class UnitRows:
    """Complete rows of one unit.

    Args:
        name: of the unit.
        time_s: (T,).
        gyro: (T, 3) rad/s, sensor axes.
        accel: (T, 3) m/s2.
        mag: (T, 3) uT with NaN where missing, or None.
    """

    name: str
    time_s: Floats
    gyro: Floats
    accel: Floats
    mag: Floats | None

    @classmethod
    def of(cls, stream: ImuStream) -> UnitRows:
        """Rows with all axes of gyroscope and accelerometer."""
        assert stream.gyro_rad_s is not None and stream.accel_m_s2 is not None
        whole = np.isfinite(stream.gyro_rad_s).all(axis=1) & np.isfinite(stream.accel_m_s2).all(axis=1)
        mag = None if stream.mag_ut is None or np.isnan(stream.mag_ut).all() else stream.mag_ut[whole]
        return cls(stream.name, stream.time_s[whole], stream.gyro_rad_s[whole], stream.accel_m_s2[whole], mag)

    def rows(self, span_s: Span) -> slice:
        """The rows with start <= time <= end."""
        first, stop = np.searchsorted(self.time_s, span_s, side="left")
        return slice(int(first), int(stop))

    def still(self, worn: bool, within_s: Span | None = None) -> list[Span]:
        """Stretches in which nothing but noise (and, worn, a person's sway) is seen, (start, end) s."""
        rows = self.rows(within_s) if within_s is not None else slice(0, len(self.time_s))
        time_s, gyro, accel = self.time_s[rows], self.gyro[rows], self.accel[rows]
        if len(time_s) < 8:
            return []
        block = np.floor((time_s - time_s[0]) / WINDOW_S).astype(int)
        edges = np.flatnonzero(np.diff(block, prepend=-1))
        counts = np.diff(np.append(edges, len(time_s)))
        scatter = np.stack([_scatter(x, edges, counts) for x in (gyro, accel)])
        calmest = np.quantile(scatter[:, counts >= 4], 0.05, axis=1) if (counts >= 4).any() else np.zeros(2)
        least = (WORN_GYRO_RAD_S, WORN_ACCEL_M_S2) if worn else (LYING_GYRO_RAD_S, LYING_ACCEL_M_S2)
        limits = np.maximum(least, NOISE_FACTOR * calmest)
        calm = (scatter <= limits[:, None]).all(axis=0) & (counts >= 4)
        ends = np.append(time_s[edges[1:]], time_s[-1])
        return joined([(time_s[e], end) for e, end, c in zip(edges, ends, calm, strict=True) if c])


def _scatter(values: Floats, edges: Indices, counts: Indices) -> Floats:
    """Largest standard deviation of the three axes in each block."""
    mean = np.add.reduceat(values, edges, axis=0) / counts[:, None]
    squares = np.add.reduceat(values**2, edges, axis=0) / counts[:, None] - mean**2
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)).max(axis=1))


def joined(spans: Sequence[Span], gap_s: float = 1e-6) -> list[Span]:
    """Spans that touch made one."""
    found: list[Span] = []
    for start, end in spans:
        if found and start - found[-1][1] <= gap_s:
            found[-1] = (found[-1][0], float(end))
        else:
            found.append((float(start), float(end)))
    return found


def common(all_spans: Sequence[Sequence[Span]]) -> list[Span]:
    """The times that lie in a span of each."""
    found = list(all_spans[0]) if all_spans else []
    for spans in all_spans[1:]:
        pairs = [(max(a[0], b[0]), min(a[1], b[1])) for a in found for b in spans]
        found = [(start, end) for start, end in pairs if end > start]
    return sorted(found)
