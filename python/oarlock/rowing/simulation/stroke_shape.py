"""The shape of a simulated sculling stroke: seat, trunk and oars over phase 0 (catch), 0.5 (finish), 1 (next catch).

Order: legs, trunk, arms in the drive; arms, trunk, legs in the recovery. Default oar angles follow NK Sports' guideline
and the Dutch federation's targets, seat travel Kleshnev's BioRow newsletters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import pi, radians

import numpy as np

from oarlock.rowing.simulation.curves import PeriodicCurve, Variation
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

# Third harmonic of the oar's speed: quick turns at catch and finish, steadier speed between.
_STEADY = 0.12
_LEGS_DOWN = PeriodicCurve.through(
    [
        *[(0.0, 0.0), (0.1, 0.27), (0.2, 0.53), (0.29, 0.78), (0.37, 0.93), (0.46, 1.0)],
        *[(0.655, 1.0), (0.74, 0.81), (0.82, 0.50), (0.91, 0.15), (0.99, 0.0)],
    ],
    smoothing=0.03,
).normalised()
_LEAN_POINTS = ((0.13, 0.0), (0.28, 0.42), (0.39, 0.79), (0.51, 1.0), (0.54, 1.0), (0.78, 0.0))
_HANDLE_HEIGHT = PeriodicCurve.through(
    [(0.0, 0.85), (0.08, 1.0), (0.42, 0.95), (0.56, 0.05), (0.75, 0.1), (0.92, 0.1)],
    smoothing=0.03,
).normalised()
_FEATHERED = PeriodicCurve.through(
    [(0.0, 0.0), (0.475, 0.0), (0.56, 1.0), (0.84, 1.0), (0.96, 0.0)],
    smoothing=0.02,
).normalised()

_SEAT_SD_M = 0.0015
_HIP_TO_SHOULDERS_M = 0.5
"""Of a rower of 1.8 m: the seat waits for a trunk that opens early by this length."""
_IN_DRIVE = 0.2
"""Sharpness with which the body begins to wait for the later hand."""
_LAST_THIRD = (0.62, 0.72)
"""Shares of the piece between which the rower passes to the shape of the last third."""
_SD_RAD = {"lean": radians(0.7), "phi": radians(0.6), "alpha": radians(0.15)}


Pair = tuple[float | Floats, float | Floats]


@dataclass(frozen=True)
class StrokeShape:
    """Ends of the movements of a stroke; pairs are (catch, finish).

    Attributes:
        seat_m: seat position, m, positive toward the feet.
        lean_rad: trunk lean, rad, positive backwards (toward the bow).
        phi_rad: horizontal oar angle, rad, negative at the catch.
        alpha_rad: vertical oar angle, rad, (recovery, drive); positive lifts the handle.
        feather_rad: turn of the oar about its axis in the recovery, rad; negative turns the top of the
            handle toward the rower, which lays the blade flat with its face up.
        late_catch_s: how much later the (right, left) hand turns at the catch, s; seat and trunk wait for
            the later one in the drive. At the finish both turn together again.
        early_back: how much earlier the trunk opens, as a share of the drive (0.1: a tenth of it); the seat waits so
            long that the shoulders go as before.
        asymmetry: 1 = the slight left/right differences of a good sculler (left hand higher and a moment
            later, individual variation); 0 = mirrored sides.
    """

    seat_m: tuple[float, float] = (0.62, 0.01)
    lean_rad: tuple[float, float] = (radians(-25.0), radians(28.0))
    phi_rad: tuple[float, float] = (radians(-61.0), radians(42.0))
    alpha_rad: tuple[float, float] = (radians(2.0), radians(8.0))
    feather_rad: float = radians(-86.0)
    asymmetry: float = 1.0
    late_catch_s: tuple[float, float] = (0.0, 0.0)
    early_back: float = 0.0

    def __post_init__(self) -> None:
        ordered = {
            "seat_m": self.seat_m[0] > self.seat_m[1],
            "lean_rad": self.lean_rad[0] < self.lean_rad[1],
            "phi_rad": self.phi_rad[0] < self.phi_rad[1],
            "alpha_rad": self.alpha_rad[0] <= self.alpha_rad[1],
        }
        for name, right in ordered.items():
            if not right:
                raise DataError(
                    f"stroke: {name} is {getattr(self, name)}; its ends are in the wrong order. At the catch the "
                    "seat is forward (larger), the trunk leans forward (negative) and phi is negative"
                )
        if not 0.0 <= self.asymmetry <= 3.0:
            raise DataError(f"stroke: asymmetry is {self.asymmetry}; give 0 (mirrored) to 3, 1 is usual")
        if not (all(0.0 <= late <= 0.15 for late in self.late_catch_s) and 0.0 <= self.early_back <= 0.2):
            raise DataError(
                f"stroke: late_catch_s is {self.late_catch_s}, early_back {self.early_back}; give 0 to 0.15 s a "
                "hand, and 0 to 0.2 of the drive"
            )

    def toward(self, last: StrokeShape | None, timing: StrokeTiming) -> Ends:
        """Ends of the movements over the knots: this shape's, in the last third of the piece those of ``last``."""
        if last is None:
            return Ends(self.seat_m, self.lean_rad, self.phi_rad, self.alpha_rad)
        done = (timing.time_s - timing.time_s[0]) / (timing.time_s[-1] - timing.time_s[0])
        part = np.clip((done - _LAST_THIRD[0]) / (_LAST_THIRD[1] - _LAST_THIRD[0]), 0.0, 1.0)
        share = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        pairs = (
            zip(getattr(self, name), getattr(last, name), strict=True)
            for name in ("seat_m", "lean_rad", "phi_rad", "alpha_rad")
        )
        return Ends(*(tuple(first + (end - first) * share for first, end in pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class Ends:
    """Seat, lean and oar angles at (catch, finish) of every knot: numbers, or (K,)."""

    seat_m: Pair
    lean_rad: Pair
    phi_rad: Pair
    alpha_rad: Pair


def oar_sweep(phase: Floats) -> Floats:
    """From 0 at the catch to 1 at the finish and back, monotone in between."""
    turn = 2.0 * pi * phase
    swing = np.cos(turn) + _STEADY / 3.0 * np.cos(3.0 * turn)
    return np.asarray(0.5 - 0.5 * swing / (1.0 + _STEADY / 3.0), dtype=np.float64)


def handle_height(phase: Floats) -> Floats:
    """From 0, low in the recovery, to 1, high in the drive."""
    return _HANDLE_HEIGHT(phase)


def between(ends: Pair, share: Floats, vary: Variation, scale: float) -> Floats:
    """From the first end (share 0) to the second (share 1); each end varies by ``scale`` from stroke to stroke."""
    first = ends[0] + vary.draw(scale)
    last = ends[1] + vary.draw(scale)
    return np.asarray(first + (last - first) * share, dtype=np.float64)


def seat_and_trunk(
    shape: StrokeShape,
    timing: StrokeTiming,
    vary: Variation,
    variation: float,
    last_third: StrokeShape | None = None,
) -> dict[str, Floats]:
    """Joints ``seat``, m, and ``trunk``, rad, (K,)."""
    ends = shape.toward(last_third, timing)
    phase = _late(timing, max(shape.late_catch_s), _IN_DRIVE)
    seat = between(ends.seat_m, _LEGS_DOWN(phase), vary, variation * _SEAT_SD_M)
    opened = _lean(0.0)(phase)
    trunk = between(ends.lean_rad, opened, vary, variation * _SD_RAD["lean"])
    if shape.early_back:
        early = trunk + (ends.lean_rad[1] - ends.lean_rad[0]) * (_lean(shape.early_back)(phase) - opened)
        seat = seat + _HIP_TO_SHOULDERS_M * (np.sin(early) - np.sin(trunk))
        trunk = early
    return {"seat": seat, "trunk": trunk}


@cache
def _lean(early_back: float) -> PeriodicCurve:
    """Of the trunk from 0 at the catch to 1 at the finish; it opens earlier by a share of the drive."""
    opening = [(phase - 0.5 * early_back, value) for phase, value in _LEAN_POINTS[:3]]
    return PeriodicCurve.through([*opening, *_LEAN_POINTS[3:]], smoothing=0.045).normalised()


def _late(timing: StrokeTiming, late_s: float, in_drive: float = 0.0) -> Floats:
    """Phase (K,) of what is late at the catch and on time at the finish; with `in_drive` in the drive alone."""
    if late_s == 0.0:
        return timing.phase
    near_catch = 0.5 + 0.5 * np.cos(2.0 * pi * timing.phase)
    if in_drive:
        near_catch = near_catch / (1.0 + np.exp(-np.sin(2.0 * pi * timing.phase) / in_drive))
    return np.asarray(timing.phase - late_s * near_catch * np.gradient(timing.phase, timing.time_s))


def single_oar(
    shape: StrokeShape, timing: StrokeTiming, vary: Variation, variation: float
) -> dict[str, Floats]:
    """Joints ``oar_phi``, ``oar_alpha`` and ``oar_theta`` (K,) of a sweep oar, rad."""
    phase = timing.phase
    return {
        "oar_phi": between(shape.phi_rad, oar_sweep(phase), vary, variation * _SD_RAD["phi"]),
        "oar_alpha": between(shape.alpha_rad, _HANDLE_HEIGHT(phase), vary, variation * _SD_RAD["alpha"]),
        "oar_theta": shape.feather_rad * _FEATHERED(phase),
    }


def body_and_oars(
    shape: StrokeShape,
    timing: StrokeTiming,
    variation: float,
    rng: np.random.Generator,
    last_third: StrokeShape | None = None,
) -> dict[str, Floats]:
    """Every joint (K,) but the arms': ``seat``, ``trunk``, ``r_oar_phi`` ... ``l_oar_theta``, rad and m.

    In the last third of the piece the ends of the movements are those of ``last_third``, if it is given.
    """
    vary = Variation(rng, timing.stroke)
    body = seat_and_trunk(shape, timing, vary, variation, last_third)
    return body | _oars(shape, shape.toward(last_third, timing), timing, vary, variation)


def _oars(
    shape: StrokeShape, ends: Ends, timing: StrokeTiming, vary: Variation, variation: float
) -> dict[str, Floats]:
    shared = [vary.draw(variation * _SD_RAD[name]) for name in ("phi", "phi", "alpha", "alpha")]
    joints = {}
    for side, sign, late_s in (("r", -1.0, shape.late_catch_s[0]), ("l", 1.0, shape.late_catch_s[1])):
        uneven = sign * shape.asymmetry
        right, left = max(-uneven, 0.0), max(uneven, 0.0)
        own = [0.4 * shape.asymmetry * vary.draw(variation * _SD_RAD[name]) for name in ("phi", "alpha")]
        phase = _late(timing, late_s) - 0.0015 * uneven
        catch = ends.phi_rad[0] + radians(0.4) * left + shared[0] + own[0]
        finish = ends.phi_rad[1] - radians(0.3) * left + shared[1] + own[0]
        joints[f"{side}_oar_phi"] = catch + (finish - catch) * oar_sweep(phase)
        low = ends.alpha_rad[0] + radians(0.6) * left + shared[2] + own[1]
        high = ends.alpha_rad[1] - radians(0.6) * right + shared[3] + own[1]
        joints[f"{side}_oar_alpha"] = low + (high - low) * _HANDLE_HEIGHT(phase)
        joints[f"{side}_oar_theta"] = shape.feather_rad * _FEATHERED(phase)
    return joints
