"""Reads study files (`load_study`). A wrong key or value is refused with its line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

from oarlock._core import Model
from oarlock.evaluation.study.keys import StudyKey, Value
from oarlock.evaluation.study.spec import Study, checked_value, keys_of
from oarlock.evaluation.study.sweeps import FaultSweep
from oarlock.evaluation.study.trial import StudySimulator, TruthFolder
from oarlock.model.load import load_model
from oarlock.storage import examples
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable

FORMAT = 1
_MOST_SEEDS = 100_000
_TOP = {"format", "title", "about", "model", "simulator", "seeds", "start_s", "frames", "joints"}
_TABLES = {"fixed", "grid", "scenario", "fault", "setting"}
_FAULT = {"name", "key", "strengths", "unit", "of", "usual", "labels", "says"}


def load_study(
    path: str | PathLike[str],
    simulators: Mapping[str, StudySimulator] | None = None,
    seeds: Sequence[int] | None = None,
) -> Study:
    """Read a study file; docs/study.md lists its keys.

    Args:
        path: the file, or the name of a shipped study.
        simulators: simulators by name, for `simulator = "name"`; `motion = "folder"` needs none.
        seeds: used instead of the file's seeds.

    Raises:
        DataError: an unknown key or an invalid value, with file, line and the nearest valid name.
        ModelError: the model's file is wrong.
    """
    top = TomlTable.read(_file(path))
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
        scenarios=_named(top, "scenario", model, keys),
        grid={key: tuple(value) for key, value in grid.items() if isinstance(value, list)},
        start_s=top.number("start_s", 2.0),
        frames=_names(top, "frames", model.frame_names),
        joints=_names(top, "joints", model.joint_names),
        title=top.string("title", top.file.stem),
        about=top.string("about", ""),
        faults=_faults(top, model, keys),
        settings=_named(top, "setting", model, keys),
    )


def shipped_studies() -> dict[str, Path]:
    """Files of the shipped studies, by name; empty if only the package is installed."""
    try:
        folder = examples.path("studies")
    except FileNotFoundError:
        return {}
    return {file.stem: file for file in sorted(folder.glob("*.toml"))}


def _file(path: str | PathLike[str]) -> Path:
    name, shipped = str(path), shipped_studies()
    if place_of(path).is_file() or Path(path).suffix:
        return Path(path)
    if name not in shipped:
        raise DataError(
            f"{name}: no shipped study has this name, and there is no such file. "
            + (did_you_mean(name, shipped) if shipped else "They come with a clone of the repository.")
        )
    return shipped[name]


def _beside(top: TomlTable, name: str) -> str:
    """A path in a study file, relative to the file."""
    own = top.file.parent / name
    return str(own) if own.suffix and own.exists() else name


def _simulator(top: TomlTable, known: Mapping[str, StudySimulator]) -> StudySimulator:
    if "motion" in top.values:
        if "simulator" in top.values:
            raise DataError(f"{top.where('motion')}: give simulator or motion, not both")
        folder = top.file.parent / top.string("motion")
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


def _named(
    top: TomlTable, kind: str, model: Model, keys: Mapping[str, StudyKey]
) -> dict[str, dict[str, Value]]:
    """Scenarios or settings: keys by name."""
    found: dict[str, dict[str, Value]] = {}
    for table in top.tables(kind) if kind in top.values else ():
        name = table.string("name")
        if not name or name in found:
            raise DataError(f"{table.where('name')}: is {name!r}; every {kind} needs a different name")
        found[name] = _flat(table, model, keys, skip=("name",))
    return found


def _faults(top: TomlTable, model: Model, keys: Mapping[str, StudyKey]) -> tuple[FaultSweep, ...]:
    return tuple(_fault(t, model, keys) for t in (top.tables("fault") if "fault" in top.values else ()))


def _fault(table: TomlTable, model: Model, keys: Mapping[str, StudyKey]) -> FaultSweep:
    table.check_keys(_FAULT | {"meanwhile"})
    strengths, of, labels = (_list(table, key) for key in ("strengths", "of", "labels"))
    try:
        fault = FaultSweep(
            name=table.string("name"),
            key=table.string("key"),
            strengths=tuple(strengths),
            unit=table.string("unit", ""),
            of=tuple(map(str, of)),
            usual=table.values.get("usual"),
            meanwhile=_flat(table.table("meanwhile", default={}), model, keys),
            labels=tuple(map(str, labels)),
            says=table.string("says", ""),
        )
    except DataError as error:
        place = "" if str(table.file) in str(error) else f"{table.where()}: "
        raise DataError(f"{place}{error}") from None
    for index in range(len(strengths)):
        try:
            checked_value(model, keys, fault.key, fault.values(index)[fault.key])
        except DataError as error:
            where = table.where("strengths" if fault.key in keys else "key")
            raise DataError(f'{where}: "{fault.key}" {error}') from None
    return fault


def _list(table: TomlTable, key: str) -> list[Value]:
    given = table.values.get(key, [])
    if not isinstance(given, list):
        raise DataError(f"{table.where(key)}: is {given!r}; expected a list")
    return given


def _flat(
    table: TomlTable,
    model: Model,
    keys: Mapping[str, StudyKey],
    many: bool = False,
    skip: Sequence[str] = (),
    prefix: str = "",
) -> dict[str, Value]:
    """Keys of a table, with dots for nested tables; each key is checked with its line."""
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
