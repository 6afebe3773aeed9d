"""The preferred arm posture of a simulated sculler whose hands follow the handles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from oarlock.rowing.simulation.curves import PeriodicCurve, Variation
from oarlock.rowing.simulation.grip import ARM_JOINTS
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.storage.arrays import Floats

# Keys at catch, mid-drive, late drive, finish, hands away, body over; degrees, right arm.
_PHASES = (0.0, 0.22, 0.38, 0.5, 0.62, 0.78)
_PREFERRED_DEG = {
    "shoulder_abduction": (6.0, 4.0, 8.0, 14.0, 8.0, 5.0),
    "shoulder_rotation": (5.0, -20.0, -28.0, -25.0, -28.0, -20.0),
    "shoulder_flexion": (58.0, 50.0, 5.0, -32.0, 10.0, 50.0),
    "elbow_flexion": (25.0, 25.0, 60.0, 95.0, 60.0, 25.0),
    "elbow_rotation": (-62.0, -64.0, -64.0, -60.0, -66.0, -64.0),
    "hand_abduction": (-42.0, -25.0, -5.0, 10.0, -5.0, -35.0),
    "hand_flexion": (-8.0, -10.0, -12.0, -15.0, -25.0, -20.0),
}
# How far each joint may stray, deg: reach decides flexion, habit the rest. Shoulder rotation is held
# tightest, since the shoulder's angles are singular at 90 deg of it.
_LOOSENESS_DEG = {
    "shoulder_abduction": 15.0,
    "shoulder_rotation": 8.0,
    "shoulder_flexion": 40.0,
    "elbow_flexion": 60.0,
    "elbow_rotation": 15.0,
    "hand_abduction": 25.0,
    "hand_flexion": 20.0,
}
_SMOOTHING = 0.05
_HABIT_SD_DEG = 1.5
WEIGHTS = np.array([100.0 * _LOOSENESS_DEG[name] ** -2.0 for name in ARM_JOINTS])
"""Cost (7,) of straying from the preferred posture; only their ratios matter."""

MIRROR = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
"""Left arm joints of the mirrored posture, from the right ones."""


def arm_curves(degrees: Mapping[str, Sequence[float]]) -> list[PeriodicCurve]:
    """A curve per joint, through its degrees at catch, mid-drive, late drive, finish, hands away, body over."""
    return [
        PeriodicCurve.through(list(zip(_PHASES, degrees[name], strict=True)), _SMOOTHING)
        for name in ARM_JOINTS
    ]


SCULLER = arm_curves(_PREFERRED_DEG)
"""Of a sculler's right arm, degrees."""


def preferred_arms(
    timing: StrokeTiming, asymmetry: float, variation: float, rng: np.random.Generator
) -> Floats:
    """Preferred arm joints (K, 2, 7) of a sculler, right arm first, rad."""
    return arms_near(SCULLER, SCULLER, timing, asymmetry, variation, rng)


def arms_near(
    right: Sequence[PeriodicCurve],
    left: Sequence[PeriodicCurve],
    timing: StrokeTiming,
    asymmetry: float,
    variation: float,
    rng: np.random.Generator,
) -> Floats:
    """Preferred arm joints (K, 2, 7), right arm first, rad, from curves as of a right arm, with a rower's habits."""
    vary = Variation(rng, timing.stroke)
    shared = _habits(vary, variation)
    arms = [
        np.stack([curve(timing.phase) for curve in curves], axis=-1)
        + shared
        + asymmetry * _habits(vary, variation)
        for curves in (right, left)
    ]
    return np.radians(np.stack([arms[0], MIRROR * arms[1]], axis=1))


def _habits(vary: Variation, variation: float) -> Floats:
    return np.stack([vary.draw(variation * _HABIT_SD_DEG) for _ in ARM_JOINTS], axis=-1)
