"""`Study`: the scenarios and seeds of a study, with checks of its keys."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from oarlock._core import Config, Model
from oarlock.evaluation.study.degrade import keys_of_streams
from oarlock.evaluation.study.faults.catalogue import keys_of_faults
from oarlock.evaluation.study.filter_inputs import check_model_key, keys_of_filter_inputs
from oarlock.evaluation.study.keys import StudyKey, Value
from oarlock.evaluation.study.sweeps import FaultSweep, fault_scenarios
from oarlock.evaluation.study.trial import StudySimulator
from oarlock.storage.errors import DataError
from oarlock.storage.names import check_name
from oarlock.storage.suggest import did_you_mean

MOST_RUNS = 100_000
_OF_FAULTS = ("fault", "strength", "label", "setting")


@dataclass(frozen=True)
class StudyScenario:
    """One combination of values. `values` has all keys; `swept` has those that differ in the study."""

    index: int
    name: str
    values: Mapping[str, Value]
    swept: Mapping[str, Value]


@dataclass(frozen=True)
class Study:
    """Scenarios times seeds.

    Args:
        model: the true model of the body.
        simulator: creates ground truth and recording for each seed.
        seeds: seeds of all random numbers; every scenario uses the same ones.
        fixed: keys with the same value in all scenarios.
        scenarios: named sets of keys; without any there is one unnamed scenario.
        grid: keys with lists of values, combined with each other and with every scenario.
        start_s: time at the beginning that is not scored, s, so that the filter can converge.
        frames: frames whose positions are also scored.
        joints: joints whose errors are averaged; empty takes all observed joints that rotate.
        title: title of the report.
        about: one or two sentences for the report.
        faults: used instead of scenarios and grid: each fault at each of its strengths, and a run without faults.
        settings: named sets of keys under which all faults are run, the default first; empty is one set without keys.

    Raises:
        DataError: a key is unknown or a value is invalid. The text names the key and the most similar valid one.
    """

    model: Model
    simulator: StudySimulator
    seeds: Sequence[int] = (0, 1, 2)
    fixed: Mapping[str, Value] = field(default_factory=dict)
    scenarios: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    grid: Mapping[str, Sequence[Value]] = field(default_factory=dict)
    start_s: float = 2.0
    frames: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    title: str = "Study"
    about: str = ""
    faults: tuple[FaultSweep, ...] = ()
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_names()
        checked = {
            "seeds": tuple(self.seeds),
            "fixed": {k: self._checked(k, v, "fixed") for k, v in self.fixed.items()},
            "scenarios": {
                name: {k: self._checked(k, v, f"scenario {name!r}") for k, v in values.items()}
                for name, values in self.scenarios.items()
            },
            "settings": {
                name: {k: self._checked(k, v, f"setting {name!r}") for k, v in values.items()}
                for name, values in self.settings.items()
            },
            "grid": {k: tuple(self._checked(k, v, "grid") for v in vs) for k, vs in self.grid.items()},
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if not self.seeds:
            raise DataError("study: no seed is given; give at least one")
        for key, values in self.grid.items():
            if not values:
                raise DataError(f'study, grid: "{key}" has no value; give a list of one or more')
        self._check_faults()
        if self.run_count > MOST_RUNS:
            raise DataError(f"study: {self.run_count} runs; the limit is {MOST_RUNS}. Sweep fewer values")

    @property
    def run_count(self) -> int:
        """Scenarios times seeds."""
        if self.faults:
            strengths = 1 + sum(len(fault.strengths) for fault in self.faults)
            return max(1, len(self.settings)) * strengths * len(self.seeds)
        return max(1, len(self.scenarios)) * math.prod(map(len, self.grid.values())) * len(self.seeds)

    @cached_property
    def keys(self) -> dict[str, StudyKey]:
        """All keys of this study except `config.*`, `parameters.*` and `model.*`."""
        return keys_of(self.model, self.simulator)

    @property
    def swept(self) -> tuple[str, ...]:
        """Keys that differ between scenarios, in the order of the file."""
        if self.faults:
            return _OF_FAULTS
        named = dict.fromkeys(key for values in self.scenarios.values() for key in values)
        return tuple(dict.fromkeys([*named, *self.grid]))

    def expanded(self) -> tuple[StudyScenario, ...]:
        """All scenarios, in order: outer loop over the named ones, inner loop over the grid."""
        return self._scenarios

    @cached_property
    def _scenarios(self) -> tuple[StudyScenario, ...]:
        return tuple(self._expanded())

    @cached_property
    def _settings(self) -> dict[str, Value]:
        return dict(Config().to_dict())

    def _expanded(self) -> Iterator[StudyScenario]:
        if self.faults:
            for index, (name, values, swept) in enumerate(fault_scenarios(self.faults, self.settings)):
                yield StudyScenario(index, name, {**self.fixed, **values}, swept)
            return
        named = self.scenarios or {"": {}}
        cells = itertools.product(*self.grid.values())
        for index, ((name, own), cell) in enumerate(itertools.product(named.items(), list(cells))):
            here = dict(zip(self.grid, cell, strict=True))
            values = {**self.fixed, **own, **here}
            label = ", ".join([*([name] if name else []), *(f"{k} {shown(v)}" for k, v in here.items())])
            swept = {key: values.get(key, self._default(key)) for key in self.swept}
            yield StudyScenario(index, label or "as given", values, swept)

    def _default(self, key: str) -> Value:
        if key.startswith("config."):
            return self._settings[key.removeprefix("config.")]
        if key.startswith("parameters."):
            return self.model.parameters[key.removeprefix("parameters.")]
        return self.keys[key].default if key in self.keys else None

    def _checked(self, key: str, value: Value, where: str) -> Value:
        try:
            return checked_value(self.model, self.keys, key, value)
        except DataError as error:
            raise DataError(f'study, {where}: "{key}" {error}') from None

    def _check_faults(self) -> None:
        if self.faults and (self.scenarios or self.grid):
            raise DataError("study: give faults and settings, or scenarios and a grid, not both")
        names = [fault.name for fault in self.faults]
        if len(set(names)) < len(names):
            raise DataError("study, faults: two faults have the same name")
        for fault in self.faults:
            for index in range(len(fault.strengths)):
                for key, value in fault.values(index).items():
                    self._checked(key, value, f'fault "{fault.name}"')

    def _check_names(self) -> None:
        named = {
            "scenario": self.scenarios,
            "setting": self.settings,
            "fault": [fault.name for fault in self.faults],
        }
        for what, own in named.items():
            for name in own:
                check_name(name, f"study, {what}")
        for what, names, known in (
            ("frames", self.frames, self.model.frame_names),
            ("joints", self.joints, self.model.joint_names),
        ):
            for name in names:
                if name not in known:
                    raise DataError(f'study, {what}: the model has no "{name}". {did_you_mean(name, known)}')


def keys_of(model: Model, simulator: StudySimulator) -> dict[str, StudyKey]:
    """Keys of the simulator, the streams and the filter's inputs."""
    filter_keys = keys_of_filter_inputs(model, simulator.lengths(model))
    return {**simulator.keys(model), **keys_of_faults(model), **keys_of_streams(model), **filter_keys}


def checked_value(model: Model, keys: Mapping[str, StudyKey], key: str, value: Value) -> Value:
    """The checked value of a key.

    Raises:
        DataError: the rest of a sentence that begins with the key.
    """
    head, _, rest = key.partition(".")
    if head == "config" and rest:
        settings = Config().to_dict()
        if rest not in settings:
            raise DataError(f"is no setting of Config. {did_you_mean(rest, settings)}")
        value = None if value == "none" else value
        try:
            setting: dict[str, Any] = {rest: value}
            Config(**setting)
        except (DataError, TypeError, ValueError) as error:
            raise DataError(f"is refused: {error}") from None
        return value
    if head == "parameters" and rest:
        if rest not in model.parameters:
            raise DataError(f"is no parameter of the model. {did_you_mean(rest, model.parameters)}")
        return StudyKey(key, "number", None, "").check(value)
    if head == "model" and rest:
        check_model_key(model, rest)
        return value
    if key not in keys:
        others = [*keys, *(f"config.{name}" for name in Config().to_dict())]
        raise DataError(f"is not known. {did_you_mean(key, others)}")
    return keys[key].check(value)


def shown(value: Value) -> str:
    """A value as a label: short lists and tables, numbers without trailing zeros."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return " ".join(f"{name} {shown(one)}" for name, one in value.items()) or "none"
    if isinstance(value, list | tuple):
        return "+".join(shown(one) for one in value) or "none"
    return "none" if value is None else str(value)


def stable_text(value: Value) -> str:
    """A text that is equal for equal values, independent of the order of keys."""
    return json.dumps(value, sort_keys=True, default=list)
