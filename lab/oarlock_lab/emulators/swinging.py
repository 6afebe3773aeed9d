"""A movement of any body that repeats without a seam, for emulated devices: every joint swings within its limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from oarlock import Recording, Track, simulate
from oarlock.live.simulated_devices import at_zero
from oarlock.model.description import JointDescription
from oarlock.simulation import Motion
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock import Model

PERIOD_S = 10.0
_KNOTS_HZ, _LEAD_S = 50.0, 1.0
_MOST_RAD, _MOST_M = 0.35, 0.05
_MOST_OF_RANGE = 0.3
_CYCLES = (3, 4, 5, 6, 7)
"""In one period: a joint swings with 0.3 to 0.7 Hz."""


def swinging(
    model: Model, rate_hz: float = 100.0, seed: int = 0, *, noise: bool = True
) -> tuple[Track, Recording]:
    """Ground truth, and the readings of one period from 0 to before `PERIOD_S`, whose end joins the start.

    Args:
        model: of the body; its joints form no loops.
        rate_hz: of all sensors.
        seed: of amplitudes, phases and noise.
        noise: white noise as the model has it.

    Raises:
        DataError: the joints form loops, so that they do not move independently.
    """
    if model.describe().closures:
        raise DataError(
            f'"{model.name}" has loops, so its joints cannot swing by themselves. Replay a recording: --replay FOLDER'
        )
    time_s = np.arange(-_LEAD_S, PERIOD_S + _LEAD_S, 1.0 / _KNOTS_HZ)
    rng = np.random.default_rng(seed)
    joints = model.describe().joints
    columns = {name: q for joint in joints for name, q in _swings(joint, time_s, rng)}
    motion = Motion(tuple(columns), time_s, np.column_stack(list(columns.values())))
    truth, recording = simulate(model, motion, seed=seed, rate_hz=rate_hz, noise=noise)
    return truth, at_zero(recording, 0.0, PERIOD_S)


def _swings(
    joint: JointDescription, time_s: Floats, rng: np.random.Generator
) -> Iterator[tuple[str, Floats]]:
    rest = np.atleast_1d(joint.rest)
    for k, (name, middle) in enumerate(zip(joint.coordinates, rest, strict=True)):
        is_place = joint.kind == "slide" or (joint.kind == "free" and k < 3)
        least, most = (-np.inf, np.inf) if joint.kind in ("ball", "free") else joint.limits
        wide = min(_MOST_M if is_place else _MOST_RAD, _MOST_OF_RANGE * (most - least))
        cycles, phase_rad = rng.choice(_CYCLES), rng.uniform(0.0, 2.0 * np.pi)
        swing = np.sin(2.0 * np.pi * cycles * time_s / PERIOD_S + phase_rad)
        yield name, np.clip(middle, least + wide, most - wide) + wide * swing
