"""The published simulation as one call: sculling, surge, noise and biases of Table 5."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from oarlock.rowing.motion import sculling
from oarlock.rowing.noise import CONDITIONS

if TYPE_CHECKING:
    from oarlock import Model, Recording, Track


def simulate_sculling(
    model: Model,
    condition: str = "B-B",
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    seed: int = 0,
) -> tuple[Track, Recording]:
    """Truth and recording of a simulated sculler.

    Args:
        model: `sculler`, or a model with its joints, frames and sensors.
        condition: `S-NB`, `B-NB`, `S-B` or `B-B`: boat still or surging, sensors without or with biases.
        duration_s: length, s.
        rate_spm: strokes per minute; two values go evenly from one to the other.
        seed: of the stroke-to-stroke variation and of the sensors' noise.

    Raises:
        ValueError: an unknown condition.
        DataError: the model cannot row so.
    """
    from oarlock import simulate

    if condition not in CONDITIONS:
        raise ValueError(f"no condition '{condition}'; Table 5 has {', '.join(CONDITIONS)}")
    chosen = CONDITIONS[condition]
    motion = sculling(model, duration_s, rate_spm, surge=chosen.boat_surge, seed=seed)
    return simulate(
        model,
        motion,
        gyro_bias_rad_s=chosen.gyro_bias_rad_s,
        accel_bias_m_s2=chosen.accel_bias_m_s2,
        seed=seed,
    )
