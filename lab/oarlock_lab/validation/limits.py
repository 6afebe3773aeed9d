"""How far the reference itself can be trusted: a clock that lags and drifts, axes that are not those of the sensors,
and jumps where markers were lost.

All look like errors of every estimate. They are found without any estimate: the angular rate of a body, by differences
of its reference orientations, has to be that of its gyroscope.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from oarlock import Recording
from oarlock.evaluation.reference import Reference
from oarlock.recording import ImuStream
from oarlock.storage.arrays import Floats

from .estimate import OrientationEstimate
from .rotations import quat_wxyz
from .scores import body_rotations

LONGEST_LAG_S = 0.15
LAG_STEP_S = 0.01
LARGEST_DRIFT = 1e-3
"""Two quartz clocks differ by less: 1000 ppm."""

TURN_PRIOR_RAD = np.radians(5.0)
"""How far a cluster may well sit askew; matters where a motion about one axis leaves the turn about it unknown."""

MAX_DIFFERENCES = 10_000
"""More of them only cost time."""

REWEIGHTINGS = 4
ALTERNATIONS = 3
INLIER_SHARE = 0.9
"""Lags are compared by the best fitting share of all differences: lost markers and filters that settle drop out."""

JUMP = 50.0
"""So many times the mean difference between both angular rates is a jump of the reference: on `dfjimu` 99.9 % of the
differences of a trial are below 35 times, and lost markers give 800 times."""

SAMPLES_THAT_TELL = 0.1
"""Neighbouring differences share their noise and their faults: so many of them count as independent."""


@dataclass(frozen=True)
class Limits:
    """What is constant between reference and sensors.

    Args:
        lag_s: how late the reference's stamps are, halfway.
        turns: body -> reference_body_from_body: the sensors' axes, nominally mounted, in those of the reference.
        rest_rad_s: body -> mean size of what is left between both angular rates, rad/s.
        drift: by how much the lag grows, s/s.
        halfway_s: the time at which the lag is `lag_s`.
        jumps_s: body -> times at which the reference jumps: between the rows before and behind.
    """

    lag_s: float
    turns: Mapping[str, Rotation]
    rest_rad_s: Mapping[str, float]
    drift: float = 0.0
    halfway_s: float = 0.0
    jumps_s: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, float]:
        """As a table shows them: ms, and deg for each body."""
        turns = {f"{b}, deg": float(np.degrees(t.magnitude())) for b, t in self.turns.items()}
        jumps = sum(len(times) for times in self.jumps_s.values())
        clock = {"lag, ms": self.lag_s * 1e3, "drift, ppm": self.drift * 1e6, "jumps": float(jumps)}
        return clock | turns

    def removed_from(self, reference: Reference) -> Reference:
        """The reference on the sensors' clock and in their axes, missing beside jumps."""
        quats = {b: np.array(q) for b, q in reference.quat_wxyz.items()}
        for body, turn in self.turns.items():
            there = reference.there(body)
            quats[body][there] = quat_wxyz(body_rotations(reference, body)[0][there] * turn)
        for body, times in self.jumps_s.items():
            nearest = np.searchsorted(reference.time_s, times)
            for offset in (-1, 0, 1):
                quats[body][np.clip(nearest + offset, 0, len(quats[body]) - 1)] = np.nan
        lag_s = _lag_at(reference.time_s, self.lag_s, self.drift, self.halfway_s)
        return replace(reference, time_s=reference.time_s - lag_s, quat_wxyz=quats)


@dataclass(frozen=True, eq=False)
class _Rates:
    """Angular rate of one body: the reference's, and the gyroscope's summed up to any time."""

    centre_s: Floats
    half_s: float
    reference_rad_s: Floats
    gyro_time_s: Floats
    rotation_rad: Floats

    def gyro_rad_s(self, lag_s: Floats | float) -> Floats:
        """Mean of the gyroscope over the spans of the reference's differences, (N, 3); NaN outside its samples."""
        ends = [self.centre_s - lag_s + side * self.half_s for side in (-1.0, 1.0)]
        first, last = (
            np.column_stack(
                [
                    np.interp(t, self.gyro_time_s, rotated, left=np.nan, right=np.nan)
                    for rotated in self.rotation_rad.T
                ]
            )
            for t in ends
        )
        return np.asarray((last - first) / (2.0 * self.half_s))


def limits(
    recording: Recording, reference: Reference, mounts: Mapping[str, Rotation] | None = None
) -> Limits:
    """Find lag and turns.

    Args:
        recording: has a stream with the name of each body.
        reference: of these bodies.
        mounts: body -> nominal body_from_sensor; the identity where none is given.
    """
    nominal = mounts or {}
    rates = {
        b: _rates(recording, reference, b, nominal.get(b, Rotation.identity())) for b in reference.bodies
    }

    def cost(lag_s: float, drift: float = 0.0) -> float:
        return sum(_fit(r, _lag_at(r.centre_s, lag_s, drift, halfway_s))[1] for r in rates.values())

    halfway_s = float((reference.time_s[0] + reference.time_s[-1]) / 2)
    coarse = np.arange(-LONGEST_LAG_S, LONGEST_LAG_S + LAG_STEP_S / 2, LAG_STEP_S)
    best = coarse[int(np.argmin([cost(lag) for lag in coarse]))]
    lag_s = _lowest(cost, best - LAG_STEP_S, best + LAG_STEP_S)
    drift = 0.0
    for _ in range(ALTERNATIONS):
        drift = _lowest(partial(cost, lag_s), -LARGEST_DRIFT, LARGEST_DRIFT)
        lag_s = _lowest(partial(cost, drift=drift), lag_s - LAG_STEP_S, lag_s + LAG_STEP_S)
    fits = {b: _fit(r, _lag_at(r.centre_s, lag_s, drift, halfway_s)) for b, r in rates.items()}
    return Limits(
        lag_s,
        {b: f[0] for b, f in fits.items()},
        {b: f[1] for b, f in fits.items()},
        drift,
        halfway_s,
        {b: rates[b].centre_s[f[2] > JUMP * f[1]] for b, f in fits.items()},
    )


def _lag_at(time_s: Floats, lag_s: float, drift: float, halfway_s: float) -> Floats:
    return np.asarray(lag_s + drift * (time_s - halfway_s))


def _lowest(cost: Callable[[float], float], low: float, high: float) -> float:
    return float(minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": 1e-6}).x)


def delay_s(
    recording: Recording, estimate: OrientationEstimate, mounts: Mapping[str, Rotation] | None = None
) -> float:
    """How late an estimate is against the gyroscopes it rests on, found as a reference's lag is; negative is early.

    Software differs in whether an orientation holds before or after the sample it comes with: half a step either way.
    """
    bodies = [b for b in estimate.quats if b in recording]
    own = Reference(estimate.name, estimate.time_s, {b: estimate.quats[b] for b in bodies})
    return limits(recording, own, mounts).lag_s


def punctual(
    recording: Recording, estimate: OrientationEstimate, mounts: Mapping[str, Rotation] | None = None
) -> OrientationEstimate:
    """The estimate without its own constant delay."""
    return replace(estimate, time_s=estimate.time_s - delay_s(recording, estimate, mounts))


def _rates(recording: Recording, reference: Reference, body: str, mount: Rotation) -> _Rates:
    stream = recording[body]
    if not isinstance(stream, ImuStream) or stream.gyro_rad_s is None:
        raise ValueError(f"{body}: the recording has no gyroscope of this body")
    turns, there = body_rotations(reference, body)
    step_s = 1.0 / reference.rate_hz
    whole = there[:-2] & there[2:] & np.isclose(reference.time_s[2:] - reference.time_s[:-2], 2 * step_s)
    change = (turns[:-2].inv() * turns[2:]).as_rotvec()[whole] / (2 * step_s)
    gyro = mount.apply(np.array(stream.gyro_rad_s))  # scipy takes no read-only arrays
    steps = np.diff(stream.time_s)[:, None] * (gyro[1:] + gyro[:-1]) / 2
    angles = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    some = slice(None, None, 1 + len(change) // MAX_DIFFERENCES)
    return _Rates(reference.time_s[1:-1][whole][some], step_s, change[some], stream.time_s, angles)


def _fit(rates: _Rates, lag_s: Floats) -> tuple[Rotation, float, Floats]:
    """The turn that takes the gyroscope to the reference (Wahba's problem, offsets free), the mean size of
    what is left, and the size of each difference, 0 where there is none.

    Sizes count, not squares (iteratively reweighted): where a cluster is lost for a moment, 50 rad/s appear.
    """
    gyro = rates.gyro_rad_s(lag_s)
    good = np.asarray(np.isfinite(gyro).all(axis=1))
    gyro, true = gyro[good], rates.reference_rad_s[good]
    turn = Rotation.identity()
    left = _sizes(true - gyro, np.ones(len(gyro)))
    for _ in range(REWEIGHTINGS):
        typical = float(np.median(left))
        weights = SAMPLES_THAT_TELL / (typical * np.maximum(left, typical))
        moments = _centred(true, weights).T @ (_centred(gyro, weights) * weights[:, None])
        u, _, vt = np.linalg.svd(moments + np.eye(3) / (2 * TURN_PRIOR_RAD**2))
        turn = Rotation.from_matrix(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)
        left = _sizes(true - turn.apply(gyro), weights)
    sizes = np.zeros(len(good))
    sizes[good] = left
    return turn, float(np.mean(np.sort(left)[: round(INLIER_SHARE * len(left))])), sizes


def _centred(rates_rad_s: Floats, weights: Floats) -> Floats:
    return np.asarray(rates_rad_s - np.average(rates_rad_s, axis=0, weights=weights))


def _sizes(rates_rad_s: Floats, weights: Floats) -> Floats:
    return np.asarray(np.linalg.norm(_centred(rates_rad_s, weights), axis=1))
