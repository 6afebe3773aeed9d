"""A study: which runs there are. Built in Python or read from a file; a wrong key is refused where it stands."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path

from oarlock._core import Config, Model
from oarlock.errors import DataError
from oarlock.io.paths import place_of
from oarlock.io.toml import TomlTable
from oarlock.models import load_model
from oarlock.study.degrade import keys_of_streams
from oarlock.study.keys import StudyKey, Value
from oarlock.study.told import check_model_key, keys_of_told
from oarlock.study.trial import StudySimulator, TruthFolder
from oarlock.suggest import did_you_mean

FORMAT = 1
MOST_RUNS = 100_000
_MOST_SEEDS = 100_000
_TOP = {"format", "title", "about", "model", "simulator", "seeds", "start_s", "frames", "joints"}
_TABLES = {"fixed", "grid", "scenario"}


@dataclass(frozen=True)
class StudyScenario:
    """One combination of values. `values` holds every key that is set; `swept` those that differ in the study."""

    index: int
    name: str
    values: Mapping[str, Value]
    swept: Mapping[str, Value]


@dataclass(frozen=True)
class Study:
    """Scenarios times seeds.

    Args:
        model: the body as it is.
        simulator: makes truth and recording of each seed.
        seeds: of all that is drawn; every scenario gets the same ones.
        fixed: keys that hold for all scenarios.
        scenarios: named sets of keys; none is one without a name.
        grid: keys with the values that they take, combined with each other and with every scenario.
        start_s: seconds that are left out of the scores; the filter settles in them.
        frames: frames whose positions are scored too.
        joints: joints whose errors make up the mean; none takes all that turn and are observed.
        title: of the report.
        about: a sentence or two for the report.

    Raises:
        DataError: an unknown key or a value that makes no sense; the text names the key and the nearest valid one.
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

    def __post_init__(self) -> None:
        self._check_names()
        checked = {
            "seeds": tuple(self.seeds),
            "fixed": {k: self._checked(k, v, "fixed") for k, v in self.fixed.items()},
            "scenarios": {
                name: {k: self._checked(k, v, f"scenario {name!r}") for k, v in values.items()}
                for name, values in self.scenarios.items()
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
        if self.run_count > MOST_RUNS:
            raise DataError(f"study: {self.run_count} runs; the most is {MOST_RUNS}. Sweep fewer values")

    @property
    def run_count(self) -> int:
        """Scenarios times seeds."""
        return max(1, len(self.scenarios)) * math.prod(map(len, self.grid.values())) * len(self.seeds)

    @cached_property
    def keys(self) -> dict[str, StudyKey]:
        """Every key that this study understands, but for `config.*`, `parameters.*` and `model.*`."""
        return keys_of(self.model, self.simulator)

    @property
    def swept(self) -> tuple[str, ...]:
        """Keys that differ between scenarios, in the order of the file."""
        named = dict.fromkeys(key for values in self.scenarios.values() for key in values)
        return tuple(dict.fromkeys([*named, *self.grid]))

    def expanded(self) -> tuple[StudyScenario, ...]:
        """All scenarios, in order: the named ones outside, the grid inside."""
        return self._scenarios

    @cached_property
    def _scenarios(self) -> tuple[StudyScenario, ...]:
        return tuple(self._expanded())

    @cached_property
    def _settings(self) -> dict[str, Value]:
        return dict(Config().to_dict())

    def _expanded(self) -> Iterator[StudyScenario]:
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

    def _check_names(self) -> None:
        for what, names, known in (
            ("frames", self.frames, self.model.frame_names),
            ("joints", self.joints, self.model.joint_names),
        ):
            for name in names:
                if name not in known:
                    raise DataError(f'study, {what}: the model has no "{name}". {did_you_mean(name, known)}')


def keys_of(model: Model, simulator: StudySimulator) -> dict[str, StudyKey]:
    """Keys of the simulator, of the streams and of what the filter is told."""
    told = keys_of_told(model, simulator.lengths(model))
    return {**simulator.keys(model), **keys_of_streams(model), **told}


def checked_value(model: Model, keys: Mapping[str, StudyKey], key: str, value: Value) -> Value:
    """The value of a key as it is used.

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
            Config(**{rest: value})
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
    """A value as a label: lists and tables in short, numbers without idle zeros."""
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
    """One text for equal values, whatever the order of keys."""
    return json.dumps(value, sort_keys=True, default=list)


# --- files --------------------------------------------------------------------------------------------


def load_study(
    path: str | PathLike[str],
    simulators: Mapping[str, StudySimulator] | None = None,
    seeds: Sequence[int] | None = None,
) -> Study:
    """Read a study file; docs/study.md lists its keys.

    Args:
        path: the file.
        simulators: what `simulator = "name"` may name; `motion = "folder"` needs none.
        seeds: instead of the file's.

    Raises:
        DataError: an unknown key or a value that makes no sense, with file, line and the nearest valid name.
        ModelError: the model's file is wrong.
    """
    top = TomlTable.read(place_of(path))
    top.check_format(FORMAT)
    top.check_keys(_TOP | _TABLES | {"motion"})
    model = load_model(_beside(top, top.string("model")))
    simulator = _simulator(top, simulators or {})
    keys = keys_of(model, simulator)
    fixed = _flat(top.table("fixed", default={}), model, keys) if "fixed" in top.values else {}
    grid = _flat(top.table("grid", default={}), model, keys, many=True) if "grid" in top.values else {}
    return Study(
        model=model,
        simulator=simulator,
        seeds=_seeds(top) if seeds is None else seeds,
        fixed=fixed,
        scenarios=_scenarios(top, model, keys),
        grid={key: tuple(value) for key, value in grid.items() if isinstance(value, list)},
        start_s=top.number("start_s", 2.0),
        frames=_names(top, "frames", model.frame_names),
        joints=_names(top, "joints", model.joint_names),
        title=top.string("title", Path(path).stem),
        about=top.string("about", ""),
    )


def _beside(top: TomlTable, name: str) -> str:
    """A path in a study file counts from the file."""
    own = place_of(top.file.parent / name)
    return str(own) if own.suffix and own.exists() else name


def _simulator(top: TomlTable, known: Mapping[str, StudySimulator]) -> StudySimulator:
    if "motion" in top.values:
        if "simulator" in top.values:
            raise DataError(f"{top.where('motion')}: give simulator or motion, not both")
        folder = place_of(top.file.parent / top.string("motion"))
        return TruthFolder(str(folder if folder.is_dir() else top.string("motion")))
    name = top.string("simulator")
    if name not in known:
        raise DataError(f'{top.where("simulator")}: there is no "{name}". {did_you_mean(name, known)}')
    return known[name]


def _seeds(top: TomlTable) -> tuple[int, ...]:
    given = top.values.get("seeds", 3)
    count = isinstance(given, int) and not isinstance(given, bool)
    if count and isinstance(given, int) and 1 <= given <= _MOST_SEEDS:
        return tuple(range(given))
    whole = isinstance(given, list) and given and all(type(s) is int and s >= 0 for s in given)
    if not whole or not isinstance(given, list):
        raise DataError(
            f"{top.where('seeds')}: is {given!r}; expected how many (1 to {_MOST_SEEDS}), or a list such as [0, 1, 2]"
        )
    return tuple(given)


def _names(top: TomlTable, key: str, known: Sequence[str]) -> tuple[str, ...]:
    given = top.values.get(key, [])
    if not isinstance(given, list):
        raise DataError(f"{top.where(key)}: is {given!r}; expected a list of names")
    for name in given:
        if name not in known:
            raise DataError(f'{top.where(key)}: the model has no "{name}". {did_you_mean(str(name), known)}')
    return tuple(given)


def _scenarios(top: TomlTable, model: Model, keys: Mapping[str, StudyKey]) -> dict[str, dict[str, Value]]:
    if "scenario" not in top.values:
        return {}
    found: dict[str, dict[str, Value]] = {}
    for table in top.tables("scenario"):
        name = table.string("name")
        if not name or name in found:
            raise DataError(f"{table.where('name')}: is {name!r}; every scenario needs a name of its own")
        found[name] = _flat(table, model, keys, skip=("name",))
    return found


def _flat(
    table: TomlTable,
    model: Model,
    keys: Mapping[str, StudyKey],
    many: bool = False,
    skip: Sequence[str] = (),
    prefix: str = "",
) -> dict[str, Value]:
    """Keys of a table with dots for tables inside it, each checked where it stands."""
    found: dict[str, Value] = {}
    for name, value in table.values.items():
        key = f"{prefix}{name}"
        if key in skip:
            continue
        if isinstance(value, dict) and key not in keys:
            found |= _flat(table.table(name), model, keys, many, skip, f"{key}.")
            continue
        if many and not isinstance(value, list):
            raise DataError(f"{table.where(name)}: is {value!r}; a grid needs a list of values, [{value!r}]")
        try:
            each = value if many and isinstance(value, list) else [value]
            checked = [checked_value(model, keys, key, one) for one in each]
        except DataError as error:
            raise DataError(f"{table.where(name)}: {error}") from None
        found[key] = checked if many else checked[0]
    return found
