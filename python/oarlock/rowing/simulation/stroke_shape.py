"""The shape of a simulated sculling stroke: seat, trunk and oars over phase 0 (catch), 0.5 (finish), 1 (next catch).

Order: legs, trunk, arms in the drive; arms, trunk, legs in the recovery. Default oar angles follow NK Sports' guideline
and the Dutch federation's targets, seat travel Kleshnev's BioRow newsletters.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.simulation.curves import PeriodicCurve, Variation
from oarlock.rowing.simulation.timing import StrokeTiming
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
_LEAN = PeriodicCurve.through(
    [(0.13, 0.0), (0.28, 0.42), (0.39, 0.79), (0.51, 1.0), (0.54, 1.0), (0.78, 0.0)],
    smoothing=0.045,
).normalised()
_HANDLE_HEIGHT = PeriodicCurve.through(
    [(0.0, 0.85), (0.08, 1.0), (0.42, 0.95), (0.56, 0.05), (0.75, 0.1), (0.92, 0.1)],
    smoothing=0.03,
).normalised()
_FEATHERED = PeriodicCurve.through(
    [(0.0, 0.0), (0.475, 0.0), (0.56, 1.0), (0.84, 1.0), (0.96, 0.0)],
    smoothing=0.02,
).normalised()

_SEAT_SD_M = 0.0015
_SD_RAD = {"lean": radians(0.7), "phi": radians(0.6), "alpha": radians(0.15)}


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
        asymmetry: 1 = the slight left/right differences of a good sculler (left hand higher and a moment
            later, individual variation); 0 = mirrored sides.
    """

    seat_m: tuple[float, float] = (0.62, 0.01)
    lean_rad: tuple[float, float] = (radians(-25.0), radians(28.0))
    phi_rad: tuple[float, float] = (radians(-61.0), radians(42.0))
    alpha_rad: tuple[float, float] = (radians(2.0), radians(8.0))
    feather_rad: float = radians(-86.0)
    asymmetry: float = 1.0

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


def oar_sweep(phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """From 0 at the catch to 1 at the finish and back, monotone in between."""
    turn = 2.0 * pi * phase
    swing = np.cos(turn) + _STEADY / 3.0 * np.cos(3.0 * turn)
    return np.asarray(0.5 - 0.5 * swing / (1.0 + _STEADY / 3.0), dtype=np.float64)


def handle_height(phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """From 0, low in the recovery, to 1, high in the drive."""
    return _HANDLE_HEIGHT(phase)


def between(
    ends: tuple[float, float], share: NDArray[np.float64], vary: Variation, scale: float
) -> NDArray[np.float64]:
    """From the first end (share 0) to the second (share 1); each end varies by ``scale`` from stroke to stroke."""
    first = ends[0] + vary.draw(scale)
    last = ends[1] + vary.draw(scale)
    return np.asarray(first + (last - first) * share, dtype=np.float64)


def seat_and_trunk(
    shape: StrokeShape, timing: StrokeTiming, vary: Variation, variation: float
) -> dict[str, NDArray[np.float64]]:
    """Joints ``seat``, m, and ``trunk``, rad, (K,)."""
    return {
        "seat": between(shape.seat_m, _LEGS_DOWN(timing.phase), vary, variation * _SEAT_SD_M),
        "trunk": between(shape.lean_rad, _LEAN(timing.phase), vary, variation * _SD_RAD["lean"]),
    }


def single_oar(
    shape: StrokeShape, timing: StrokeTiming, vary: Variation, variation: float
) -> dict[str, NDArray[np.float64]]:
    """Joints ``oar_phi``, ``oar_alpha`` and ``oar_theta`` (K,) of a sweep oar, rad."""
    phase = timing.phase
    return {
        "oar_phi": between(shape.phi_rad, oar_sweep(phase), vary, variation * _SD_RAD["phi"]),
        "oar_alpha": between(shape.alpha_rad, _HANDLE_HEIGHT(phase), vary, variation * _SD_RAD["alpha"]),
        "oar_theta": shape.feather_rad * _FEATHERED(phase),
    }


def body_and_oars(
    shape: StrokeShape, timing: StrokeTiming, variation: float, rng: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Every joint (K,) but the arms': ``seat``, ``trunk``, ``r_oar_phi`` ... ``l_oar_theta``, rad and m."""
    vary = Variation(rng, timing.stroke)
    return seat_and_trunk(shape, timing, vary, variation) | _oars(shape, timing, vary, variation)


def _oars(
    shape: StrokeShape, timing: StrokeTiming, vary: Variation, variation: float
) -> dict[str, NDArray[np.float64]]:
    shared = [vary.draw(variation * _SD_RAD[name]) for name in ("phi", "phi", "alpha", "alpha")]
    joints = {}
    for side, sign in (("r", -1.0), ("l", 1.0)):
        uneven = sign * shape.asymmetry
        right, left = max(-uneven, 0.0), max(uneven, 0.0)
        own = [0.4 * shape.asymmetry * vary.draw(variation * _SD_RAD[name]) for name in ("phi", "alpha")]
        phase = timing.phase - 0.0015 * uneven
        catch = shape.phi_rad[0] + radians(0.4) * left + shared[0] + own[0]
        finish = shape.phi_rad[1] - radians(0.3) * left + shared[1] + own[0]
        joints[f"{side}_oar_phi"] = catch + (finish - catch) * oar_sweep(phase)
        low = shape.alpha_rad[0] + radians(0.6) * left + shared[2] + own[1]
        high = shape.alpha_rad[1] - radians(0.6) * right + shared[3] + own[1]
        joints[f"{side}_oar_alpha"] = low + (high - low) * _HANDLE_HEIGHT(phase)
        joints[f"{side}_oar_theta"] = shape.feather_rad * _FEATHERED(phase)
    return joints
