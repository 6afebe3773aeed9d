"""What `oarlock study` can simulate of rowing: sculling as modelled, and sculling as in the field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from oarlock import StudyKey, StudyTrial
from oarlock.rowing.motion import sculling
from oarlock.rowing.noise import CONDITIONS, SimulatedCondition

if TYPE_CHECKING:
    from oarlock import Model

_SHARED = (
    StudyKey(
        "condition", "choice", "B-B", "boat still or surging, biases of Table 5 or none", choices=tuple(CONDITIONS)
    ),
    StudyKey("duration_s", "number", 40.0, "length", least=1.0, most=36_000.0),
    StudyKey("rate_spm", "numbers", [20.0, 34.0], "strokes per minute; two go evenly", least=10.0, most=60.0),
)


@dataclass(frozen=True)
class ScullingSimulator:
    """Sculling of `oarlock.rowing.sculling`: everything is as modelled, but for the boat's surge, noise and biases."""

    def keys(self, model: Model) -> Mapping[str, StudyKey]:
        """Condition, length, stroke rate and variation beside the shared settings of sensors."""
        own = (StudyKey("variation", "number", 1.0, "stroke-to-stroke variation", least=0.0, most=5.0),)
        biases = {
            name: StudyKey(name, "by_name", None, StudyTrial.KEYS[name].about, optional=True)
            for name in ("gyro_bias_rad_s", "accel_bias_m_s2")
        }
        return {**StudyTrial.KEYS, **biases, **{key.name: key for key in (*_SHARED, *own)}}

    def lengths(self, model: Model) -> tuple[str, ...]:
        """Lengths of the body: the pins and the oars are the boat's."""
        return body_lengths(model)

    def trial(self, model: Model, values: Mapping[str, object], seed: int) -> StudyTrial:
        """Biases are those of the condition where the study sets none."""
        chosen = CONDITIONS[str(values["condition"])]
        motion = sculling(
            model,
            float(str(values["duration_s"])),
            spm(values["rate_spm"]),
            surge=chosen.boat_surge,
            variation=float(str(values["variation"])),
            seed=seed,
        )
        return StudyTrial.of_motion(model, motion, dict(values) | _biases(chosen, values), seed)


def _biases(chosen: SimulatedCondition, values: Mapping[str, object]) -> dict[str, object]:
    usual = {"gyro_bias_rad_s": chosen.gyro_bias_rad_s, "accel_bias_m_s2": chosen.accel_bias_m_s2}
    return {name: bias if values[name] is None else values[name] for name, bias in usual.items()}


def body_lengths(model: Model) -> tuple[str, ...]:
    """Parameters that are lengths of the rower: `l_b`, `l_ua_r`; not the pins, nor the inboard of the oars."""
    return tuple(n for n in model.parameters if n.startswith("l_") and not n.startswith(("l_oar", "l_pin")))


def spm(value: object) -> float | tuple[float, ...]:
    """A rate, or rates that go evenly from one to the next."""
    return tuple(float(v) for v in value) if isinstance(value, list | tuple) else float(str(value))


SIMULATORS = {"sculling": ScullingSimulator()}
"""By the name that a study file gives them."""
