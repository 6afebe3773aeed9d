"""Faults of inertial units that the force at each joint shows: both of its units must read one size of it.

Source: T. Seel, T. Schauer and J. Raisch 2012, "Joint axis and position estimation from inertial measurement data by
exploiting kinematic constraints", equation 6. Here the joint's place is known, and faults are sought. No orientation
is needed, so nothing depends on a filter, a start or a heading.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from oarlock.calibration.static.link_pairs import ROOT, link_pairs
from oarlock.calibration.static.worn_model import Worn
from oarlock.evaluation.suspects.changes import (
    GRAVITY_M_S2,
    LESS_USUAL,
    UNIT_FIELDS,
    FaultCorrection,
    changed_rows,
    exchanges,
    gyro_units,
    turns,
    unit_signs,
)
from oarlock.evaluation.suspects.rest_gravity import RestGravity
from oarlock.evaluation.suspects.suspect import Suspect, of_units
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.recording.butterworth import passed_twice
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.recording import Recording

RATE_HZ, CUTOFF_HZ = 50.0, 5.0
"""Readings are compared at this rate, without what is faster: skin, and hits that each unit filters in its own way."""
WINDOW_S = 8.0
"""A fault may begin in the middle; the parts of a recording are compared in windows of this length, s."""
MOST_WINDOWS = 12
LEAST_M_S2 = 0.3
"""Forces that differ by no more agree in any case."""
UNUSUAL = 0.06
"""Square of the difference over that of the force's changes, above which a fault is sought. Rigs have 0.01 to 0.1,
shoulders of people up to 1: there only a change that explains it tells that it was a fault."""
EXPLAINS, CLOSE = 3.0, 1.25
"""A change must lower the misfit by this factor, and is not told from others within the second."""
REST, REST_OF_CLOCKS = 0.3, 1.0
"""Largest misfit of a joint that an explanation leaves. Shoulders of people have up to 1 without any fault."""
LATEST_S = 4.0
"""Clocks are compared up to this lag, s."""
LEAST_LAG_S = 0.04
LEAST_TURN_RAD, LEAST_BIAS_M_S2, LEAST_SCALE = 0.2, 0.7, 0.08
"""Smaller errors are those of usual mounts and units."""


@dataclass(frozen=True, eq=False)
class _GridReadings:
    """(T, 3) rad/s and m/s2 of one unit on the common grid, and where they are no interpolation over a gap."""

    gyro_rad_s: Floats
    accel_m_s2: Floats
    there: Bools

    def changed(self, by: Floats | float, fields: Sequence[str] = UNIT_FIELDS) -> _GridReadings:
        """With some of its quantities times a factor, or turned by a matrix."""
        gyro, accel = (
            changed_rows(rows, by) if field in fields else rows
            for field, rows in (("gyro_rad_s", self.gyro_rad_s), ("accel_m_s2", self.accel_m_s2))
        )
        return _GridReadings(gyro, accel, self.there)

    def later(self, rows: Floats) -> _GridReadings:
        """As they are with a clock set back by so many rows, one number or one a row."""
        at = np.arange(len(self.there)) + rows
        near = np.clip(np.round(at).astype(int), 0, len(self.there) - 1)
        inside = (at >= 0) & (at <= len(self.there) - 1)
        return _GridReadings(self.gyro_rad_s[near], self.accel_m_s2[near], self.there[near] & inside)

    def rows(self, rows: slice) -> _GridReadings:
        return _GridReadings(self.gyro_rad_s[rows], self.accel_m_s2[rows], self.there[rows])

    def force(self, lever: Floats) -> Floats:
        """(T,) size of the force at a joint, m/s2; `lever`: from the joint to the unit, in the unit's axes, m."""
        turning = np.gradient(self.gyro_rad_s, 1.0 / RATE_HZ, axis=0)
        w2 = np.einsum("ij,ij->i", self.gyro_rad_s, self.gyro_rad_s)
        swung = self.gyro_rad_s * (self.gyro_rad_s @ lever)[:, None] - w2[:, None] * lever
        x, y, z = lever
        tx, ty, tz = turning.T
        swung += np.stack([ty * z - tz * y, tz * x - tx * z, tx * y - ty * x], axis=1)
        return np.asarray(np.linalg.norm(self.accel_m_s2 - swung, axis=1))


@dataclass(frozen=True, eq=False)
class JointForces:
    """The units of a recording, and the joints between them.

    Args:
        start_s: of the grid, s.
        units: readings of each unit.
        joints: pairs of units.
        levers: by joint, from it to both of its units in their axes, m.
    """

    start_s: float
    units: Mapping[str, _GridReadings]
    joints: tuple[tuple[str, str], ...]
    levers: tuple[tuple[Floats, Floats], ...]

    @classmethod
    def of(cls, model: Model, recording: Recording, calibration: Calibration | None) -> JointForces | None:
        """None if no joint with a centre lies between two units that read."""
        modelled = {unit.name for unit in model.describe().inertial_units}
        whole = [
            s
            for s in recording
            if isinstance(s, ImuStream)
            and s.gyro_rad_s is not None
            and s.accel_m_s2 is not None
            and s.name in modelled
        ]
        worn = Worn.of(model, calibration)
        try:
            pairs = link_pairs(worn.model, [s.name for s in whole], "suspects", False)
        except DataError:
            return None
        pairs = tuple(pair for pair in pairs if pair.center is not None and pair.parent != ROOT)
        used = [s for s in whole if any(s.name in pair.units for pair in pairs)]
        if not used:
            return None
        start_s = min(s.time_s[0] for s in used)
        end_s = min(max(s.time_s[-1] for s in used), start_s + WINDOW_S * MOST_WINDOWS)
        grid = start_s + np.arange(int((end_s - start_s) * RATE_HZ)) / RATE_HZ
        units = {s.name: r for s in used if (r := _on(s, grid)) is not None}
        joints = [pair for pair in pairs if all(name in units for name in pair.units)]
        if not joints:
            return None
        return cls(start_s, units, tuple(p.units for p in joints), tuple(worn.levers(p) for p in joints))

    def misfits(self) -> Floats:
        """(n_joints,) squared differences of the force over that of its changes."""
        return np.array([self.misfit(k, self.units) for k in range(len(self.joints))])

    def agreeing(self) -> frozenset[str]:
        """Units that agree with all their neighbours."""
        unusual = {
            name
            for joint, x in zip(self.joints, self.misfits(), strict=True)
            if not x <= UNUSUAL
            for name in joint
        }
        return frozenset(self.units) - unusual

    def fits_scale(self, name: str, scale: float) -> bool:
        """Whether the joints of a unit agree better if its gyroscope is multiplied by so much."""
        own = [k for k, joint in enumerate(self.joints) if name in joint]
        units = {**self.units, name: self.units[name].changed(scale, ("gyro_rad_s",))}
        return sum(self.misfit(k, units) for k in own) < sum(self.misfit(k, self.units) for k in own)

    def misfit(self, k: int, units: Mapping[str, _GridReadings]) -> float:
        """Of one joint."""
        (a, b), (first, second) = self.joints[k], self.levers[k]
        there = units[a].there & units[b].there
        if np.count_nonzero(there) < RATE_HZ:
            return float("nan")
        forces = [units[name].force(lever)[there] for name, lever in ((a, first), (b, second))]
        # The smaller change: a fault may enlarge one of the two.
        changes = min(float(np.var(force)) for force in forces)
        return float(np.mean((forces[0] - forces[1]) ** 2) / (changes + LEAST_M_S2**2))

    def residual(self, name: str, change: Readings) -> Floats:
        """(N,) differences of the forces at the joints of one unit, m/s2, with a change of its readings."""
        units, parts = {**self.units, **change(self.units)}, []
        for (a, b), (first, second) in zip(self.joints, self.levers, strict=True):
            if name in (a, b):
                there = self.units[a].there & self.units[b].there
                parts.append((units[a].force(first) - units[b].force(second))[there])
        return np.concatenate(parts)

    def cost_of_lags(self, k: int, name: str, lags: NDArray[np.int_]) -> Floats:
        """(n_lags,) misfit of a joint if one of its units is late by so many rows."""
        (a, b), levers = self.joints[k], self.levers[k]
        own, other = (0, 1) if a == name else (1, 0)
        force, still = (self.units[(a, b)[i]].force(levers[i]) for i in (own, other))
        there, whole = self.units[name].there, self.units[(a, b)[other]].there
        changes, costs = min(float(np.var(force)), float(np.var(still))) + LEAST_M_S2**2, list[float]()
        for lag in lags:
            if 2 * abs(int(lag)) > len(force):
                costs.append(np.inf)
                continue
            late, now = (
                slice(max(0, lag), len(force) + min(0, lag)),
                slice(max(0, -lag), len(force) + min(0, -lag)),
            )
            both = there[late] & whole[now]
            enough = np.count_nonzero(both) > 0.5 * len(force)
            squared = float(np.mean((force[late] - still[now])[both] ** 2)) if enough else np.inf
            costs.append(squared / changes)
        return np.array(costs)

    def part(self, rows: slice) -> JointForces:
        """Some rows of it."""
        return replace(
            self,
            start_s=self.start_s + (rows.start or 0) / RATE_HZ,
            units={name: readings.rows(rows) for name, readings in self.units.items()},
        )

    def windows(self) -> list[slice]:
        """The rows in windows."""
        rows = len(next(iter(self.units.values())).there)
        count = int(np.clip(rows / (WINDOW_S * RATE_HZ), 1, MOST_WINDOWS))
        edges = np.linspace(0, rows, count + 1).astype(int)
        return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def _on(stream: ImuStream, grid: Floats) -> _GridReadings | None:
    assert stream.gyro_rad_s is not None and stream.accel_m_s2 is not None
    columns = np.hstack([stream.gyro_rad_s, stream.accel_m_s2])
    read = _interpolated(stream.time_s, columns, grid)
    return None if read is None else _GridReadings(read[0][:, :3], read[0][:, 3:], read[1])


def on_grid_of(
    stream: ImuStream,
) -> tuple[Floats, Floats, Floats | None, Bools] | None:
    """Gyroscope, accelerometer and magnetometer of one unit on an even grid, and where they read; None if too few."""
    if stream.gyro_rad_s is None or stream.accel_m_s2 is None:
        return None
    end_s = min(stream.time_s[-1], stream.time_s[0] + WINDOW_S * MOST_WINDOWS)
    grid = stream.time_s[0] + np.arange(int((end_s - stream.time_s[0]) * RATE_HZ)) / RATE_HZ
    read = _on(stream, grid)
    if read is None:
        return None
    field = None if stream.mag_ut is None else _interpolated(stream.time_s, stream.mag_ut, grid)
    if field is None:
        return read.gyro_rad_s, read.accel_m_s2, None, read.there
    return read.gyro_rad_s, read.accel_m_s2, field[0], read.there & field[1]


def _interpolated(time_s: Floats, columns: Floats, grid: Floats) -> tuple[Floats, Bools] | None:
    whole = np.isfinite(columns).all(axis=1)
    time_s, columns = time_s[whole], columns[whole]
    if len(time_s) < RATE_HZ or len(grid) < RATE_HZ:
        return None
    step_s = max(float(np.median(np.diff(time_s))), 1.0 / RATE_HZ)
    if step_s > 2.5 / RATE_HZ:
        return None
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    gap = time_s[after] - time_s[after - 1] > 4.0 * step_s
    there = ~gap & (grid >= time_s[0]) & (grid <= time_s[-1])
    rows = np.column_stack([np.interp(grid, time_s, column) for column in columns.T])
    return passed_twice(rows, RATE_HZ, CUTOFF_HZ), there


# --- what may be wrong --------------------------------------------------------------------------------

Readings: TypeAlias = Callable[[Mapping[str, _GridReadings]], dict[str, _GridReadings]]


@dataclass(frozen=True, eq=False)
class _Cause:
    """One way to change the readings of some units; other fields: see `Suspect` and `FaultCorrection`."""

    fault: str
    streams: tuple[str, ...]
    text: str
    error_rad: float
    change: Readings
    rarity: float = 1.0
    of_force: Floats | None = None


def _discrete(names: Sequence[str]) -> Iterator[_Cause]:
    """Exchanged units, wrong signs, units of rates and axes."""
    for change in (*exchanges([names]), *unit_signs(names, False), *gyro_units(names), *turns(names)):
        error_rad = {"exchanged": np.pi / 2, "sign": np.pi, "unit": np.pi, "axes": np.pi / 2}.get(
            change.fault
        )
        if error_rad is None:
            error_rad = float(np.arccos(np.clip((np.trace(change.matrix) - 1.0) / 2.0, -1.0, 1.0)))
        changed = partial(_changed, change)
        yield _Cause(
            change.fault, change.streams, change.text, error_rad, changed, change.rarity, change.of_force
        )


def _changed(change: FaultCorrection, units: Mapping[str, _GridReadings]) -> dict[str, _GridReadings]:
    if change.names:
        return {other: units[name] for name, other in change.names.items()}
    return {name: units[name].changed(change.matrix, change.fields) for name in change.streams}


def _mounted(forces: JointForces, name: str) -> _Cause:
    """A mount that is off by any rotation, as far as forces tell it."""

    def turn(x: Floats) -> Readings:
        matrix = matrix_from_quat(quat_from_rotvec(x))
        return lambda units: {name: units[name].changed(matrix)}

    best = _fit(forces, name, turn, 3, 0.3)
    angle_rad = float(np.linalg.norm(best))
    text = (
        f"{name} sits turned by about {np.degrees(angle_rad):.0f} deg against its mount: check how it is worn, and "
        "calibrate mounts (`oarlock calibrate`)."
    )
    matrix = matrix_from_quat(quat_from_rotvec(best))
    return _Cause("mount", (name,), text, angle_rad, turn(best), LESS_USUAL, matrix)


def _biased(forces: JointForces, name: str) -> _Cause:
    def shift(x: Floats) -> Readings:
        return lambda units: {name: replace(units[name], accel_m_s2=units[name].accel_m_s2 - x)}

    best = _fit(forces, name, shift, 3, 1.0)
    size = float(np.linalg.norm(best))
    text = (
        f"accelerometer of {name} looks biased by {size:.2g} m/s2: calibrate it, lay the unit on six sides "
        "(docs/mounts.md)."
    )
    return _Cause("bias", (name,), text, min(1.0, size / GRAVITY_M_S2), shift(best), LESS_USUAL)


def _late(forces: JointForces, name: str) -> Iterator[_Cause]:
    """A clock that is late by one time, or by one that grows."""
    lags = _lags(forces, name)
    rate = float(np.sqrt(np.mean(np.sum(forces.units[name].gyro_rad_s ** 2, axis=1))))
    others = ", ".join(
        sorted({other for joint in forces.joints if name in joint for other in joint} - {name})
    )
    lag = lags.whole
    if abs(lag) >= LEAST_LAG_S * RATE_HZ:
        lag_s = lag / RATE_HZ
        text = (
            f"clock of {name} is {abs(lag_s):.2f} s {'late' if lag > 0 else 'early'} against {others}: subtract "
            f"{lag_s:.2f} s from its time stamps, or find its offset (`oarlock calibrate clocks`)."
        )
        change: Readings = lambda units: {name: units[name].later(np.array([lag], dtype=np.float64))}  # noqa: E731
        yield _Cause("clock", (name,), text, min(np.pi, abs(lag_s) * rate), change)
    if lags.line is not None:
        first, slope = lags.line
        rows = np.arange(len(forces.units[name].there))
        warp = np.asarray(first + slope * rows, dtype=np.float64)
        end_s = np.abs(warp).max() / RATE_HZ
        if abs(slope) * len(rows) >= 2.0 * LEAST_LAG_S * RATE_HZ:
            speed = f"{abs(100.0 * slope):.2g} % {'slow' if slope < 0 else 'fast'}"
            text = (
                f"clock of {name} runs {speed} against {others}: find its drift (`oarlock calibrate clocks`), or "
                "synchronise the units while they record."
            )
            drift: Readings = lambda units: {name: units[name].later(warp)}  # noqa: E731
            yield _Cause("clock", (name,), text, min(np.pi, end_s * rate), drift, LESS_USUAL)


def _fit(
    forces: JointForces, name: str, changed: Callable[[Floats], Readings], size: int, prior: float
) -> Floats:
    """Least squares over the joints of one unit by Gauss-Newton steps; `prior`: usual size of what is sought."""
    x, step = np.zeros(size), 0.02 * prior
    for _ in range(5):
        residual = forces.residual(name, changed(x))
        slopes = np.column_stack(
            [(forces.residual(name, changed(x + step * axis)) - residual) / step for axis in np.eye(size)]
        )
        information = slopes.T @ slopes / len(residual) + np.eye(size) * 1e-3 / prior**2
        x = x - np.clip(np.linalg.solve(information, slopes.T @ residual / len(residual)), -prior, prior)
    return np.asarray(x)


@dataclass(frozen=True, eq=False)
class _Lags:
    whole: int
    line: tuple[float, float] | None


def _lags(forces: JointForces, name: str) -> _Lags:
    """By how many rows a unit is late in all and, if that grows evenly, where it begins and by how much a row."""
    lags = np.arange(-round(LATEST_S * RATE_HZ), round(LATEST_S * RATE_HZ) + 1)
    costs, middles = [], []
    for rows in forces.windows():
        part = forces.part(rows)
        costs.append(
            np.sum([part.cost_of_lags(k, name, lags) for k, j in enumerate(part.joints) if name in j], axis=0)
        )
        middles.append(0.5 * (rows.start + rows.stop))
    whole = int(lags[int(np.argmin(np.sum(costs, axis=0)))])
    best = [lags[int(np.argmin(cost))] for cost in costs if np.isfinite(cost).any()]
    if len(best) < 3 or len(best) < len(costs):
        return _Lags(whole, None)
    slope = float(
        np.median([(b - a) / (y - x) for (x, a), (y, b) in combinations(zip(middles, best, strict=True), 2)])
    )
    first = float(np.median(np.array(best) - slope * np.array(middles)))
    apart = np.abs(np.array(best) - first - slope * np.array(middles))
    return _Lags(whole, (first, slope) if np.median(apart) < 2.0 else None)


# --- the search ---------------------------------------------------------------------------------------


def joint_suspects(
    forces: JointForces, gravity: RestGravity, deadline: Callable[[], bool], most: int = 3
) -> tuple[list[Suspect], bool]:
    """What explains that units contradict each other, the largest first, and whether all was tried in time."""
    suspects: list[Suspect] = []
    while len(suspects) < most:
        part, from_s = _worst_part(forces)
        if deadline():
            return suspects, False
        whole = _best(forces, gravity, None)
        tries = [(whole, forces), (None if from_s is None else _best(part, gravity, from_s), part)]
        both = [(*best, units) for best, units in tries if best is not None]
        if not both:
            break
        # A part that explains itself better than the whole: the fault began in the middle.
        suspect, cause, forces = min(
            both,
            key=lambda b: b[0].misfit_after / b[0].misfit_before / (3.0 if np.isnan(b[0].start_s) else 1.0),
        )
        suspects.append(suspect)
        forces = replace(forces, units={**forces.units, **cause.change(forces.units)})
    return suspects, True


def _worst_part(forces: JointForces) -> tuple[JointForces, float | None]:
    """The windows from where units contradict each other much more than before, and when that begins, s."""
    windows = forces.windows()
    each = np.nan_to_num(np.array([forces.part(rows).misfits() for rows in windows]))
    worst = each.max(axis=1)
    bad = (worst > UNUSUAL) & (worst > 4.0 * worst.min())
    if bad.all() or not bad.any():
        return forces, None
    first, last = (int(np.flatnonzero(bad)[i]) for i in (0, -1))
    return forces.part(slice(windows[first].start, windows[last].stop)), forces.start_s + windows[
        first
    ].start / RATE_HZ


def _best(forces: JointForces, gravity: RestGravity, from_s: float | None) -> tuple[Suspect, _Cause] | None:
    misfits = forces.misfits()
    unusual = [k for k, misfit in enumerate(misfits) if misfit > UNUSUAL]
    if not unusual:
        return None
    suspicious = sorted({name for k in unusual for name in forces.joints[k]})
    causes = [*_discrete(suspicious)]
    for name in suspicious:
        causes += [*_late(forces, name), _mounted(forces, name), _biased(forces, name)]
    tried = []
    for cause in causes:
        own = [
            k
            for k, joint in enumerate(forces.joints)
            if set(joint) & set(cause.streams) and np.isfinite(misfits[k])
        ]
        before = float(sum(misfits[own]))
        units = {**forces.units, **cause.change(forces.units)}
        # A change that leaves too little to compare explains nothing: it has no number.
        after = float(sum(forces.misfit(k, units) for k in own)) * cause.rarity
        left = REST_OF_CLOCKS if cause.fault in ("clock", "exchanged") else REST
        explains = after * EXPLAINS < before and before > UNUSUAL and after < left * len(own)
        if explains and _is_large(cause) and not gravity.contradicts(cause.streams, cause.of_force, from_s):
            tried.append((before - after, before, after, cause))
    if not tried:
        return None
    tried.sort(key=lambda one: -one[0])
    gain, before, after, best = tried[0]
    near = [
        c
        for g, _, _, c in tried[1:]
        if gain - g < 0.1 * gain and (c.fault, c.streams) != (best.fault, best.streams)
    ]
    others = tuple(dict.fromkeys(cause.text for cause in near[:2]))
    since_s = np.nan if from_s is None else from_s
    words = (best.fault, best.streams, best.text, float(best.error_rad))
    return of_units(*words, (before, after), since_s, others), best


def _is_large(cause: _Cause) -> bool:
    return cause.fault not in ("mount", "bias") or cause.error_rad > (
        LEAST_TURN_RAD if cause.fault == "mount" else LEAST_BIAS_M_S2 / GRAVITY_M_S2
    )
