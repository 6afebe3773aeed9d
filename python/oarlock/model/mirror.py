"""Copies one side of a body to the other: `[mirror]` of model files, for `model_file`.

The plane of the mirror goes through the origin of the frame that both sides hang on, across one of its axes. Positions
change the sign of that coordinate. A rotation R becomes S R S with S the reflection, so a hinge's axis changes the sign
of the other two: a positive angle means the same movement on both sides.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from oarlock.storage.errors import DataError

Document = dict[str, Any]

_KEYS = ("from", "to", "across")
_NAME = re.compile(r"[A-Za-z_]\w*")
_REFERENCES = ("name", "parent", "joint", "frame", "heading_group")
_SIDES = {"right": "left", "left": "right", "Right": "Left", "Left": "Right"}


def with_mirror(document: Document) -> Document:
    """The document with the other side of all that `[mirror]` names, and without that table.

    Raises:
        DataError: a key is wrong, or something to mirror is of a kind that this cannot mirror.
    """
    if "mirror" not in document:
        return document
    rest = {key: value for key, value in document.items() if key != "mirror"}
    mirror = _mirror_of(document["mirror"])
    for kind in ("closure", "base_acceleration"):
        if any(mirror.is_sided(table["name"]) for table in rest.get(kind, ())):
            raise DataError(f"mirror: a [[{kind}]] is not mirrored; write both sides")
    for kind, copied in (("joint", mirror.joint), ("frame", mirror.frame), ("sensor", mirror.sensor)):
        tables = rest.get(kind, [])
        sided = [table for table in tables if mirror.is_sided(table["name"])]
        rest[kind] = [*tables, *(copied(table) for table in sided)]
    own = rest.get("parameters", {})
    rest["parameters"] = {
        **own,
        **{
            mirror.named(name): mirror.worded(copy.deepcopy(own[name]))
            for name in own
            if mirror.is_sided(name)
        },
    }
    return rest


@dataclass(frozen=True)
class _Mirror:
    """One side's suffix, the other's, and the number of the axis across the plane."""

    source: str
    target: str
    across: int

    def is_sided(self, name: str) -> bool:
        return name.endswith(self.source)

    def named(self, name: str) -> str:
        return name.removesuffix(self.source) + self.target if self.is_sided(name) else name

    def joint(self, table: Document) -> Document:
        made = self._copied(table)
        if isinstance(rest := made.get("rest"), list):
            if len(rest) != 3:
                raise DataError(f'mirror: joint "{table["name"]}" is free; write both sides')
            made["rest"] = self._turn(rest)
        cone = made.get("limits")
        if isinstance(cone, dict) and "twist" in cone and cone["axis"] != "xyz"[self.across]:
            made["limits"] = {**cone, "twist": [_negated(bound) for bound in reversed(cone["twist"])]}
        return made

    def frame(self, table: Document) -> Document:
        if "dh" in table:
            raise DataError(f'mirror: frame "{table["name"]}" has a dh row; mirror frames with a transform')
        made = self._copied(table)
        if "axis" in made:
            made["axis"] = self._axis(made["axis"])
        made["transform"] = self._placed(made["transform"], "translation")
        return made

    def sensor(self, table: Document) -> Document:
        made = self._copied(table)
        if "mount" in made:
            made["mount"] = self._placed(made["mount"], "offset")
        if "contact" in made:
            made["contact"] = self._placed(made["contact"], "point")
        if "point" in made:
            made["point"] = self._shift(made["point"])
        return made

    def worded(self, value: Any) -> Any:
        """A table whose label names the other side."""
        if isinstance(value, dict) and "label" in value:
            value["label"] = " ".join(_SIDES.get(word, word) for word in value["label"].split(" "))
        return value

    def _copied(self, table: Document) -> Document:
        made = {key: self._renamed(copy.deepcopy(value)) for key, value in table.items() if key != "label"}
        named = {key: self.named(table[key]) for key in _REFERENCES if key in table}
        return self.worded({**made, **named, **({"label": table["label"]} if "label" in table else {})})  # type: ignore[no-any-return]

    def _renamed(self, value: Any) -> Any:
        """Expressions with the parameters of the other side."""
        if isinstance(value, str):
            return _NAME.sub(lambda found: self.named(found[0]), value)
        if isinstance(value, list):
            return [self._renamed(part) for part in value]
        return {k: self._renamed(v) for k, v in value.items()} if isinstance(value, dict) else value

    def _placed(self, pose: Document, position: str) -> Document:
        made = dict(pose)
        if position in made:
            made[position] = self._shift(made[position])
        if "rpy" in made:
            made["rpy"] = self._turn(made["rpy"])
        if "rotation" in made:
            made["rotation"] = [
                [
                    value if (i == self.across) == (j == self.across) else _negated(value)
                    for j, value in enumerate(row)
                ]
                for i, row in enumerate(made["rotation"])
            ]
        return made

    def _shift(self, values: list[Any]) -> list[Any]:
        return [_negated(value) if k == self.across else value for k, value in enumerate(values)]

    def _turn(self, values: list[Any]) -> list[Any]:
        return [value if k == self.across else _negated(value) for k, value in enumerate(values)]

    def _axis(self, axis: Any) -> Any:
        if not isinstance(axis, str):
            return self._turn(axis)
        letter = axis.removeprefix("-")
        if letter == "xyz"[self.across]:
            return axis
        return letter if axis.startswith("-") else f"-{letter}"


def _mirror_of(table: Any) -> _Mirror:
    if not isinstance(table, Mapping) or set(table) != set(_KEYS):
        raise DataError('mirror: expected { from = "_r", to = "_l", across = "z" }')
    if table["across"] not in ("x", "y", "z"):
        raise DataError(f'mirror.across: is {table["across"]!r}; expected "x", "y" or "z"')
    for key in ("from", "to"):
        if not isinstance(table[key], str) or not table[key]:
            raise DataError(f'mirror.{key}: is {table[key]!r}; expected the end of names, for example "_r"')
    return _Mirror(table["from"], table["to"], "xyz".index(table["across"]))


def _negated(value: Any) -> Any:
    if isinstance(value, str):
        return f"-({value})"
    return -value if value else value
