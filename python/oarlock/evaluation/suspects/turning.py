"""Faults of a gyroscope that its own unit shows: a direction fixed in the room turns in the unit's axes.

The magnetic field is such a direction, and so is gravity while nothing else accelerates the unit: d' = -w x d. In any
other movement the mean force over seconds is gravity, but for the change of the speed over that time. Neither a model
nor another unit is needed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from oarlock.evaluation.suspects.changes import MIRRORS, PROPER, gyro_units
from oarlock.evaluation.suspects.joint_forces import LEAST_M_S2, RATE_HZ, on_grid_of
from oarlock.evaluation.suspects.suspect import Suspect, axes_text, of_units
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Bools, Floats

PARTS = 8
SPAN_S = 0.24
"""Over which a direction turns, s."""
NEAR_FIELD, NEAR_REST = 0.1, 0.1
"""Share by which |mag| and |accel| may differ from their medians."""
AS_RECORDED = np.eye(3)
WINDOW_S, WINDOWS_EVERY_S = 3.0, 0.5
"""Over which the force is averaged where the unit is accelerated, and how often, s."""
CALM = 0.06
"""Scatter of |accel| over its median up to which gravity alone is read."""
LEAST_RATE = 0.08
"""Root mean square of a direction's change below which nothing is told, per s."""
FITS, EXPLAINS = 0.3, 3.0
"""Share of the changes that a right gyroscope leaves unexplained, and factor between a wrong one and a right one."""
HELPS = 2.0
"""Factor by which a scale and biases must lower what mean forces leave: sound units 1.3, others 2.1."""
LEAST_SCALE, SURE = 0.07, 4.0
LEAST_BIAS_RAD_S, LEAST_STEP_RAD_S = np.radians(6.0), np.radians(3.0)
"""A bias is not told from iron that moves with the unit by less; a change of the bias is."""


@dataclass(frozen=True, eq=False)
class _Sums:
    """Sums over rows of squares of the slopes by matrix (9, row by row) and shift (3), and of their products."""

    squares: Floats
    products: Floats
    change: float
    rows: int

    def __add__(self, other: _Sums) -> _Sums:
        return _Sums(
            self.squares + other.squares,
            self.products + other.products,
            self.change + other.change,
            self.rows + other.rows,
        )

    def fit(self, axes: Floats = AS_RECORDED) -> tuple[float, Floats, float]:
        """Scale and shift (3,) that fit best with these axes, and the share of the changes that is left."""
        basis = np.zeros((12, 4))
        basis[:9, 0], basis[9:, 1:] = axes.ravel(), np.eye(3)
        squares, products = basis.T @ self.squares @ basis, basis.T @ self.products
        solved = np.linalg.solve(squares + 1e-9 * np.eye(4) * max(1.0, float(np.trace(squares))), products)
        return (
            float(solved[0]),
            np.asarray(solved[1:], dtype=np.float64),
            max(0.0, 1.0 - float(solved @ products) / self.change),
        )

    def shift(self, scale: float) -> Floats:
        """(3,) what is added to the rates at this scale, rad/s."""
        squares = self.squares[9:, 9:] + 1e-6 * self.rows * np.eye(3)
        fixed = np.concatenate([scale * np.eye(3).ravel(), np.zeros(3)])
        return np.asarray(np.linalg.solve(squares, (self.products - self.squares @ fixed)[9:]))


def own_suspect(stream: ImuStream) -> tuple[Suspect, float] | None:
    """What is wrong with a unit's gyroscope, and by which factor its readings are wrong; or None."""
    read = on_grid_of(stream)
    if read is None:
        return None
    gyro, accel, field, there = read
    for rows, near in ((field, NEAR_FIELD), (accel, NEAR_REST)):
        if rows is None or not there.any():
            continue
        norm = np.linalg.norm(rows, axis=1)
        middle = float(np.median(norm[there]))
        if middle == 0.0 or (rows is accel and float(np.std(norm[there])) > CALM * middle):
            continue
        usable = there & (np.abs(norm / middle - 1.0) < near)
        parts = [
            part for part in _parts(gyro, rows / np.maximum(norm, 1e-9)[:, None], usable) if part is not None
        ]
        if len(parts) >= PARTS // 2:
            return _explained(stream, parts, "magnetometer" if rows is field else "accelerometer")
    return _explained_by_means(stream, gyro, accel, there)


def _explained_by_means(
    stream: ImuStream, gyro: Floats, accel: Floats, there: Bools
) -> tuple[Suspect, float] | None:
    width = round(WINDOW_S * RATE_HZ)
    starts = np.arange(0, len(gyro) - 2 * width, round(WINDOWS_EVERY_S * RATE_HZ))
    gaps = np.concatenate([[0], np.cumsum(~there)])
    starts = starts[gaps[starts + 2 * width] == gaps[starts]]
    parts = [_MeanForces(gyro, accel, part) for part in np.array_split(starts, PARTS) if len(part) > 1]
    whole = _MeanForces(gyro, accel, starts)
    if len(parts) < PARTS:
        return None
    fits = [part.fit() for part in parts]
    left = float(np.median([share for *_, share in fits]))
    if left >= FITS or whole.left(1.0, np.zeros(3)) <= HELPS * left:
        return None
    scales = whole.fit()[0], np.array([scale for scale, *_ in fits])
    return _scaled_or_biased(stream, parts, scales, "accelerometer")


@dataclass(frozen=True, eq=False)
class _MeanForces:
    """Rates and forces (T, 3) of a unit, and the rows where two adjacent windows of `WINDOW_S` begin."""

    gyro: Floats
    accel: Floats
    starts: NDArray[np.int_]

    def differences(self, scale: float, shift: Floats) -> Floats:
        """(N, 3) mean force of the second window less that of the first, m/s2, in the axes of its begin."""
        width, first = round(WINDOW_S * RATE_HZ), int(self.starts[0])
        rows = slice(first, int(self.starts[-1]) + 2 * width + 1)
        turned = _orientations(scale * self.gyro[rows] + shift)
        sums = np.cumsum(np.einsum("tij,tj->ti", turned, self.accel[rows]), axis=0)
        a, b, c = (sums[self.starts - first + k * width] for k in range(3))
        return np.asarray(np.einsum("tji,tj->ti", turned[self.starts - first], c - 2.0 * b + a) / width)

    def fit(self) -> tuple[float, Floats, float]:
        """Scale and shift (3,) that fit best, and the share of the changes that is left."""
        solved = self._solve(np.array([1.0, 0.0, 0.0, 0.0]), np.eye(4))
        return float(solved[0]), solved[1:], self.left(solved[0], solved[1:])

    def left(self, scale: float, shift: Floats) -> float:
        """Squared differences over those of a unit that does not turn."""
        still = float(np.sum(self.differences(0.0, np.zeros(3)) ** 2))
        return float(np.sum(self.differences(scale, shift) ** 2)) / max(still, 1e-9)

    def shift(self, scale: float) -> Floats:
        """(3,) what is added to the rates at this scale, rad/s."""
        begin = np.array([scale, 0.0, 0.0, 0.0])
        return np.asarray(self._solve(begin, np.eye(4)[1:])[1:])

    def _solve(self, values: Floats, free: Floats) -> Floats:
        """Least squares by Gauss-Newton steps along the rows of `free`, (n, 4)."""
        step = 1e-3
        for _ in range(4):
            residual = self.differences(values[0], values[1:]).ravel()
            moved = [values + step * way for way in free]
            slopes = np.column_stack(
                [(self.differences(v[0], v[1:]).ravel() - residual) / step for v in moved]
            )
            # What a few windows do not show stays near what it was: 0.3 of the scale, 0.3 rad/s.
            information = slopes.T @ slopes + np.eye(len(free)) * LEAST_M_S2**2 / 0.3**2
            change = np.linalg.solve(information, slopes.T @ residual)
            values = values - np.clip(change, -0.3, 0.3) @ free
        return np.asarray(values)


def _orientations(rates: Floats) -> Floats:
    """(T, 3, 3) axes of the first row from those of each row, by products of twice as many rotations at a time."""
    steps = np.vstack([np.zeros((1, 3)), 0.5 * (rates[1:] + rates[:-1])]) / RATE_HZ
    turned, apart = matrix_from_quat(quat_from_rotvec(steps)), 1
    while apart < len(turned):
        turned = np.concatenate([turned[:apart], turned[:-apart] @ turned[apart:]])
        apart *= 2
    return np.asarray(turned)


def _parts(gyro: Floats, direction: Floats, usable: Bools) -> Iterator[_Sums | None]:
    width = round(SPAN_S * RATE_HZ)
    change = (direction[width:] - direction[:-width]) / SPAN_S
    sums = np.cumsum(np.concatenate([np.zeros((1, 3, 12)), _slopes(gyro, direction)]), axis=0)
    slopes = (sums[width:-1] - sums[: -width - 1]) / width
    whole = usable[width:] & usable[:-width]
    edges = np.linspace(0, len(change), PARTS + 1).astype(int)
    for a, b in pairwise(edges):
        rows = np.arange(a, b)[whole[a:b]]
        own, turned = slopes[rows], change[rows]
        total = float(np.sum(turned**2))
        if len(rows) < RATE_HZ or total < len(rows) * LEAST_RATE**2:
            yield None
            continue
        yield _Sums(np.einsum("tij,tik->jk", own, own), np.einsum("tij,ti->j", own, turned), total, len(rows))


def _slopes(gyro: Floats, direction: Floats) -> Floats:
    """(T, 3, 12) derivatives of a direction's change by the matrix from readings to rates, and by what is added."""
    x, y, z = direction.T
    none = np.zeros(len(x))
    cross = np.stack(
        [np.stack([none, -z, y], 1), np.stack([z, none, -x], 1), np.stack([-y, x, none], 1)], axis=1
    )
    by_matrix = np.einsum("tir,tc->tirc", cross, gyro).reshape(-1, 3, 9)
    return np.concatenate([by_matrix, cross], axis=2)


def _explained(stream: ImuStream, parts: list[_Sums], by: str) -> tuple[Suspect, float] | None:
    name, whole, gyro = (stream.name,), sum(parts[1:], parts[0]), "gyro_rad_s"
    tried = [(whole.fit(axes), axes) for axes in (np.eye(3), -np.eye(3), *MIRRORS, *PROPER)]
    (scale, _, left), _ = tried[0]
    (_, _, best_left), axes = min(
        (t for t in tried if t[0][0] > 0.0), key=lambda t: t[0][2], default=tried[0]
    )
    if min(left, best_left) > FITS:
        return None
    if best_left * EXPLAINS < left or (scale <= 0.0 and best_left < left):
        return of_units("axes", name, axes_text(name, (gyro,), axes), np.pi / 2), 1.0
    if left > FITS:
        return None
    for change in gyro_units(name):
        if 0.6 < scale / change.matrix < 1.6:
            return of_units("unit", name, change.text, np.pi), 1.0
    scales = np.array([part.fit()[0] for part in parts])
    return _scaled_or_biased(stream, parts, (scale, scales), by)


def _scaled_or_biased(
    stream: ImuStream, parts: Sequence[_Sums | _MeanForces], scales: tuple[float, Floats], by: str
) -> tuple[Suspect, float] | None:
    """`scales`: that of all parts together, and of each."""
    scale, each = scales
    std = 1.5 * float(np.median(np.abs(each - np.median(each)))) / np.sqrt(len(each))
    if abs(scale - 1.0) > max(LEAST_SCALE, SURE * std):
        text = (
            f"gyroscope of {stream.name} reads {1.0 / scale:.2f} times the rate at which its {by} turns: set scale = "
            f"{scale:.3f} for gyro in the mapping file, or calibrate the {by}, if that is wrong."
        )
        return of_units("scale", (stream.name,), text, abs(1.0 / scale - 1.0)), scale
    biased = _bias(stream, parts, scale, by)
    return None if biased is None else (biased, 1.0)


def _bias(stream: ImuStream, parts: Sequence[_Sums | _MeanForces], scale: float, by: str) -> Suspect | None:
    """A bias that all parts of the recording show alike, or one that changes between two of them."""
    name, count = stream.name, len(parts)
    each = np.array([part.shift(scale) for part in parts])
    tried = [
        (_apart(each[:k], each[k:]), LEAST_STEP_RAD_S, "changes its bias by") for k in range(2, count - 1)
    ]
    tried.sort(key=lambda one: -one[0][1])
    whole = _apart(np.zeros((2, 3)), each)
    for (size, times_std), least, words in (*tried[:1], (whole, LEAST_BIAS_RAD_S, "looks biased by")):
        if size > least and times_std > SURE:
            text = (
                f"gyroscope of {name} {words} {np.degrees(size):.1f} deg/s against its {by}: let the unit rest for "
                "10 s before the recording, and subtract what it reads then."
            )
            return of_units("bias", (name,), text, size)
    return None


def _apart(first: Floats, second: Floats) -> tuple[float, float]:
    """Distance of the means of two groups (n, 3), and how many standard deviations the surest axis has of it."""
    away = np.concatenate([first - first.mean(axis=0), second - second.mean(axis=0)])
    scatter = np.sqrt(np.sum(away**2, axis=0) / max(1, len(away) - 2))
    difference = second.mean(axis=0) - first.mean(axis=0)
    std = np.maximum(scatter * np.sqrt(1.0 / len(first) + 1.0 / len(second)), np.radians(0.05))
    return float(np.linalg.norm(difference)), float((np.abs(difference) / std).max())
