"""Reads targets of technique by boat class, each with its source, for technique and reports."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from math import pi
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType

from oarlock.rowing.analysis.features import FEATURES
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_text

# Ending of a key in the file, ending of the column, factor.
_UNITS = (
    ("_deg", "_rad", pi / 180.0),
    ("_ms", "_s", 1e-3),
    ("_percent", "", 1e-2),
    ("_ratio", "", 1.0),
    ("_m", "_m", 1.0),
    ("_s", "_s", 1.0),
)


@dataclass(frozen=True)
class Target:
    """A published target: from `low` to `high`, the same for a single number, in the column's unit."""

    name: str
    low: float
    high: float
    source: str

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


def _shipped() -> str:
    return files("oarlock.rowing.analysis").joinpath("targets.toml").read_text(encoding="utf-8")


TARGET_CLASSES: Mapping[str, str] = MappingProxyType(
    {name: str(table.get("words", name)) for name, table in tomllib.loads(_shipped()).items()}
)
"""Boat classes of the shipped file, with what they are."""


def load_targets(which: str | PathLike[str]) -> Mapping[str, Target]:
    """Targets by column.

    Args:
        which: a class of `TARGET_CLASSES`; or a file like `oarlock/rowing/targets.toml` with one class in it, or
            FILE:CLASS where it has several.

    Raises:
        DataError: no such class or file, or a key or value that is not understood.
    """
    name = fspath(which)
    if name in TARGET_CLASSES:
        return _targets(tomllib.loads(_shipped())[name], f"targets '{name}'")
    path, _, chosen = name.partition(".toml:")
    place = Path(path + ".toml" if chosen else name)
    if not place.is_file():
        raise DataError(
            f"targets: '{name}' is neither a file nor one of {', '.join(TARGET_CLASSES)}. Copy targets.toml of "
            "oarlock.rowing, change it, and give its path"
        )
    try:
        classes = tomllib.loads(read_text(place))
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"targets: {place}: {error}") from None
    if chosen not in classes and len(classes) != 1:
        raise DataError(f"targets: {place} has the classes {', '.join(classes)}; name one: {place}:CLASS")
    chosen = chosen or next(iter(classes))
    return _targets(classes[chosen], f"targets: {place}, [{chosen}]")


def _targets(table: object, where: str) -> Mapping[str, Target]:
    if not isinstance(table, dict):
        raise DataError(f"{where}: expected a table of targets")
    rows = (_target(key, entry, where) for key, entry in table.items() if key != "words")
    return MappingProxyType({target.name: target for target in rows})


def _target(key: str, entry: object, where: str) -> Target:
    name, scale = _column(key, where)
    value = entry.get("value") if isinstance(entry, dict) else None
    ends = value if isinstance(value, list) else [value, value]
    numbers = [end for end in ends if isinstance(end, int | float) and not isinstance(end, bool)]
    if not isinstance(entry, dict) or len(numbers) != 2 or numbers[0] > numbers[1]:
        raise DataError(
            f'{where}: {key} is {entry!r}; give {{ value = 44, source = "whose" }} or value = [from, to]'
        )
    return Target(name, numbers[0] * scale, numbers[1] * scale, str(entry.get("source", "own")))


def _column(key: str, where: str) -> tuple[str, float]:
    for ending, unit, scale in _UNITS:
        name = key.removesuffix(ending) + unit
        if key.endswith(ending) and name in FEATURES:
            return name, scale
    raise DataError(
        f"{where}: '{key}' is no column of oarlock.rowing.FEATURES with one of the units "
        f"{', '.join(ending for ending, _, _ in _UNITS)}"
    )
