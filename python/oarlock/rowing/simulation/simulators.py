"""The rowing simulators of `oarlock lab study`: sculling as modelled, and sculling with field errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import radians
from typing import TYPE_CHECKING

from oarlock.rowing.field.effects import GROUPS, FieldEffects
from oarlock.rowing.field.trial import FieldTrial, simulate_field
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.rowing.simulation.hull import HullRotation
from oarlock.rowing.simulation.motion import sculling
from oarlock.rowing.simulation.noise import CONDITIONS, SimulatedCondition
from oarlock.storage.errors import DataError
from oarlock.studies import StudyKey, StudySimulator, StudyTrial

if TYPE_CHECKING:
    from oarlock import Model

_SHARED = (
    StudyKey(
        "condition",
        "choice",
        "B-B",
        "boat still or surging, biases of Table 5 or none",
        choices=tuple(CONDITIONS),
    ),
    StudyKey("duration_s", "number", 40.0, "length", least=1.0, most=36_000.0),
    StudyKey("rate_spm", "numbers", [20.0, 34.0], "strokes per minute; two go evenly", least=10.0, most=60.0),
)


_HULL = tuple(
    StudyKey(f"hull_{axis}_deg", "number", 0.0, f"amplitude of the hull's {axis}", least=0.0, most=30.0)
    for axis in ("pitch", "roll", "yaw")
)


@dataclass(frozen=True)
class ScullingSimulator:
    """Sculling of `oarlock.rowing.sculling`: everything is as modelled, but for the boat's surge, noise and biases."""

    def keys(self, model: Model) -> Mapping[str, StudyKey]:
        """Condition, length, stroke rate and variation, in addition to the common sensor settings."""
        own = (StudyKey("variation", "number", 1.0, "stroke-to-stroke variation", least=0.0, most=5.0),)
        biases = {
            name: StudyKey(name, "by_name", None, StudyTrial.KEYS[name].about, optional=True)
            for name in ("gyro_bias_rad_s", "accel_bias_m_s2")
        }
        return {**StudyTrial.KEYS, **biases, **{key.name: key for key in (*_SHARED, *_HULL, *own)}}

    def lengths(self, model: Model) -> tuple[str, ...]:
        """Lengths of the body: the pins and the oars are the boat's."""
        return body_lengths(model)

    def trial(self, model: Model, values: Mapping[str, object], seed: int) -> StudyTrial:
        """Biases are those of the condition where the study sets none."""
        if any(values[key.name] for key in _HULL):
            return _in_turning_hull(model, values, seed)
        chosen = CONDITIONS[str(values["condition"])]
        motion = sculling(
            model,
            _number(values["duration_s"]),
            spm(values["rate_spm"]),
            surge=chosen.boat_surge,
            variation=_number(values["variation"]),
            seed=seed,
        )
        return StudyTrial.of_motion(model, motion, dict(values) | _biases(chosen, values), seed)


def _in_turning_hull(model: Model, values: Mapping[str, object], seed: int) -> StudyTrial:
    """With the model file's noise and rate: that simulation takes no others."""
    usual = {name: key.default for name, key in ScullingSimulator().keys(model).items()}
    for name in (*StudyTrial.KEYS, "variation"):
        if values[name] != usual[name]:
            raise DataError(
                f"{name} cannot be changed together with hull_pitch_deg, hull_roll_deg, hull_yaw_deg"
            )
    angles = {axis: radians(_number(values[f"hull_{axis}_deg"])) for axis in ("pitch", "roll", "yaw")}
    truth, recording = simulate_sculling(
        model,
        str(values["condition"]),
        _number(values["duration_s"]),
        spm(values["rate_spm"]),
        seed,
        hull_rotation=HullRotation(angles["pitch"], angles["roll"], angles["yaw"]),
    )
    return StudyTrial(truth, recording)


def _number(value: object) -> float:
    assert isinstance(value, int | float)
    return float(value)


def _biases(chosen: SimulatedCondition, values: Mapping[str, object]) -> dict[str, object]:
    usual = {"gyro_bias_rad_s": chosen.gyro_bias_rad_s, "accel_bias_m_s2": chosen.accel_bias_m_s2}
    return {name: bias if values[name] is None else values[name] for name, bias in usual.items()}


def body_lengths(model: Model) -> tuple[str, ...]:
    """Parameters that are lengths of the rower: `l_b`, `l_ua_r`; not the pins, nor the inboard of the oars."""
    return tuple(n for n in model.parameters if n.startswith("l_") and not n.startswith(("l_oar", "l_pin")))


def spm(value: object) -> float | tuple[float, ...]:
    """A rate, or rates that go evenly from one to the next."""
    return tuple(float(v) for v in value) if isinstance(value, list | tuple) else _number(value)


PRESETS = {
    "careful": FieldEffects(),
    "wild": FieldEffects.wild(),
    "misfit": FieldEffects.misfit(),
    "off": FieldEffects.off(),
}


@dataclass(frozen=True)
class FieldSimulator:
    """Sculling of `oarlock.rowing.simulate_field`, in which nothing is as modelled."""

    def keys(self, model: Model) -> Mapping[str, StudyKey]:
        """Condition, length, stroke rate; which effects, and how strong."""
        names = tuple(FieldEffects().strengths())
        some, groups = "effects, or groups of them, that are on; none is all", (*GROUPS, *names)
        own = [
            StudyKey(
                "rate_hz", "number", 125.0, "samples per second of every sensor", least=1.0, most=2000.0
            ),
            StudyKey("effects", "choice", "careful", "which set of effects", choices=tuple(PRESETS)),
            StudyKey("strength", "number", 1.0, "times all of them", least=0.0, most=10.0),
            StudyKey("only_effects", "names", None, some, choices=groups, optional=True),
            *(
                StudyKey(f"effect.{name}", "number", None, "strength of this effect alone", optional=True)
                for name in names
            ),
        ]
        return {key.name: key for key in (*_SHARED, *own)}

    def lengths(self, model: Model) -> tuple[str, ...]:
        """Lengths of the body: the pins and the oars are the boat's."""
        return body_lengths(model)

    def trial(self, model: Model, values: Mapping[str, object], seed: int) -> StudyTrial:
        """Truth and recording; the filter has the model as it is given, the athlete another one."""
        made = self.field_trial(model, values, seed)
        return StudyTrial(made.truth, made.recording)

    def field_trial(self, model: Model, values: Mapping[str, object], seed: int) -> FieldTrial:
        """The same with the markers."""
        return simulate_field(
            model,
            field_effects(values),
            condition=str(values["condition"]),
            duration_s=_number(values["duration_s"]),
            rate_spm=spm(values["rate_spm"]),
            rate_hz=_number(values["rate_hz"]),
            seed=seed,
        )


def field_effects(values: Mapping[str, object]) -> FieldEffects:
    """The effects that a study's values ask for."""
    found = PRESETS[str(values.get("effects", "careful"))]
    if isinstance(only := values.get("only_effects"), list):
        found = found.only(*only)
    strength = _number(values.get("strength", 1.0))
    found = found if strength == 1.0 else found.scaled(strength)
    alone = {name.removeprefix("effect."): v for name, v in values.items() if name.startswith("effect.")}
    told = {name: _number(value) for name, value in alone.items() if value is not None}
    return replace(found, **told)


SIMULATORS: Mapping[str, StudySimulator] = {"sculling": ScullingSimulator(), "field": FieldSimulator()}
"""By the name that a study file gives them."""
