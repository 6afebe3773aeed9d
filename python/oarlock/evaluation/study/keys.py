"""`StudyKey`: the keys that a study may vary, each with its kind, bounds and description."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

Value: TypeAlias = object
ONE = "one"
"""Used instead of a stream's name: one inertial unit, a different one for each seed."""
Kind: TypeAlias = Literal["number", "numbers", "integer", "boolean", "choice", "names", "by_name"]


@dataclass(frozen=True)
class StudyKey:
    """A quantity that a study can vary.

    Args:
        name: key in a study file; contains its unit.
        kind: a number; a number or a list of them ("numbers"); a whole number; true or false; a choice; a list of
            names; a number, or a table of numbers by name ("by_name").
        default: value if the study does not set it.
        about: description in one line.
        least: smallest allowed number.
        most: largest allowed number.
        choices: the texts of a choice, or the names allowed in a list or table.
        optional: whether None is allowed ("not done").
    """

    name: str
    kind: Kind
    default: Value
    about: str
    least: float = -math.inf
    most: float = math.inf
    choices: tuple[str, ...] = ()
    optional: bool = False

    def check(self, value: Value) -> Value:
        """The checked value in its final form.

        Raises:
            DataError: a value of another kind or out of bounds; the text says what was expected.
        """
        if value is None and self.optional:
            return None
        if self.optional and value == "none":
            return None
        if self.kind == "boolean":
            if not isinstance(value, bool):
                raise DataError(f"is {value!r}; expected true or false")
            return value
        if self.kind == "choice":
            return self._choice(value)
        if self.kind == "names":
            return self._names(value)
        if self.kind == "numbers" and isinstance(value, Sequence) and not isinstance(value, str):
            return [self._number(one) for one in value]
        if self.kind == "by_name" and isinstance(value, Mapping):
            return {self._name(str(name)): self._number(one) for name, one in sorted(value.items())}
        number = self._number(value)
        if self.kind == "integer" and number != int(number):
            raise DataError(f"is {value!r}; expected a whole number")
        return int(number) if self.kind == "integer" else number

    def _number(self, value: Value) -> float:
        if (
            not isinstance(value, int | float)
            or isinstance(value, bool)
            or not abs(value) <= sys.float_info.max
        ):
            table = " or a table { name = number }" if self.kind == "by_name" else ""
            raise DataError(f"is {value!r}; expected a finite number{table}")
        if not self.least <= value <= self.most:
            raise DataError(f"is {value:g}; expected {self._bounds()}")
        return float(value)

    def _bounds(self) -> str:
        if math.isinf(self.most):
            return f"{self.least:g} or more"
        return f"{self.least:g} to {self.most:g}"

    def _choice(self, value: Value) -> str:
        if not isinstance(value, str) or value not in self.choices:
            raise DataError(f"is {value!r}. {did_you_mean(str(value), self.choices)}")
        return value

    def _names(self, value: Value) -> list[str]:
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise DataError(f'is {value!r}; expected a list of names, such as ["{self._example()}"]')
        return [self._name(one) for one in value]

    def _name(self, value: Value) -> str:
        if not isinstance(value, str):
            raise DataError(f'contains {value!r}; expected names, such as "{self._example()}"')
        if self.choices and value not in self.choices:
            raise DataError(f'contains "{value}". {did_you_mean(value, self.choices)}')
        return value

    def _example(self) -> str:
        return self.choices[0] if self.choices else "back"


def sized(
    name: str, about: str, choices: tuple[str, ...], least: float = 0.0, most: float = math.inf
) -> StudyKey:
    """A key of numbers by name, 0 where nothing is changed."""
    return StudyKey(name, "by_name", 0.0, about, least, most, choices)


def by_name(keys: Sequence[StudyKey]) -> dict[str, StudyKey]:
    """Keys by name."""
    return {key.name: key for key in keys}


def number_for(value: Value, name: str, default: float = 0.0) -> float:
    """The number for one name: its entry in a table, otherwise the common number."""
    if isinstance(value, Mapping):
        return float(value.get(name, default))
    return float(value) if isinstance(value, int | float) else default


def with_turns(values: Mapping[str, Value], units: Sequence[str], seed: int) -> dict[str, Value]:
    """Values in which `one` is replaced by a unit. With as many seeds as units each unit is used once."""
    turn = units[seed % len(units)] if units else ONE

    def told(value: Value) -> Value:
        if isinstance(value, Mapping) and ONE in value:
            return {turn if name == ONE else name: number for name, number in value.items()}
        if isinstance(value, list) and ONE in value:
            return [turn if name == ONE else name for name in value]
        return value

    return {key: told(value) for key, value in values.items()}
