"""Cuts a part out of a body: `[part]` of model files, and `Model.with_units`.

The part hangs on a segment of its own, which moves as the whole body did: freely, if that was free.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from oarlock.model.edit import Document, Table, document_of, model_of
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

_NAME = re.compile(r"[A-Za-z_]\w*")
_ROOT = "root"
_MOVES_FREELY = ("free", "ball")


def with_part(document: Document) -> Document:
    """The document cut to what its `[part]` names, and without that table.

    Raises:
        DataError: a key is wrong, or a frame is not there or not beyond the part's root.
    """
    if "part" not in document:
        return document
    rest = {key: value for key, value in document.items() if key != "part"}
    part = document["part"]
    if (
        not isinstance(part, Mapping)
        or set(part) != {"root", "frames"}
        or not isinstance(part["frames"], list)
    ):
        raise DataError('part: expected { root = "FRAME", frames = ["FRAME", ...] }')
    return part_of(rest, part["root"], part["frames"])


def with_units(model: Model, units: Iterable[str]) -> Model:
    """See `Model.with_units`."""
    document = document_of(model)
    wanted = list(dict.fromkeys(units))
    sensors = {table["name"]: table for table in document.get("sensor", ())}
    for name in wanted:
        if name not in sensors:
            raise DataError(
                f'units: the model "{model.name}" has no sensor "{name}". {did_you_mean(name, sensors)}'
            )
    if not wanted:
        raise DataError(f"units: none is named; the model has {', '.join(sensors)}")
    document["sensor"] = [table for name, table in sensors.items() if name in wanted]
    if document.get("closure"):
        # a closure carries what one side's sensors read to the other
        return model_of(document, model)
    frames = [frame for name in wanted for frame in _frames_of(sensors[name], document)]
    return model_of(part_of(document, _common_root(document, frames), frames), model)


def part_of(document: Document, root: str, frames: Iterable[str]) -> Document:
    """The frames from a root to some others, what is fixed to them, and their joints, sensors and parameters.

    Raises:
        DataError: a frame is not there or not beyond the root.
    """
    tables = {table["name"]: table for table in document["frame"]}
    keep = {root} - {_ROOT}
    for frame in frames:
        path = _path(tables, frame)
        if root not in path:
            raise DataError(f'part: frame "{frame}" does not hang on "{root}"')
        keep |= set(path[path.index(root) :]) - {_ROOT}
    while (
        more := {name for name, table in tables.items() if table["parent"] in keep and "joint" not in table}
        - keep
    ):
        keep |= more
    made = dict(document)
    made["frame"] = [table for name, table in tables.items() if name in keep]
    if root != _ROOT:
        _set_free(made, tables, root)
    joints = {table.get("joint") for table in made["frame"]}
    made["joint"] = [table for table in made["joint"] if table["name"] in joints]
    made["sensor"] = [table for table in document.get("sensor", ()) if _stays(table, keep | {_ROOT}, joints)]
    made["closure"] = [
        table for table in document.get("closure", ()) if _stays(table, keep | {_ROOT}, joints)
    ]
    made = {key: value for key, value in made.items() if value or key not in ("sensor", "closure")}
    return without_unused_parameters(made)


def _set_free(made: Document, tables: Mapping[str, Table], root: str) -> None:
    """Puts the part's root where the body's was, moved by the same kind of joint under the part's own name."""
    first = _path(tables, root)[1]
    if first == root:
        return
    joint = next(table for table in made["joint"] if table["name"] == tables[first]["joint"])
    if joint["kind"] not in _MOVES_FREELY:
        raise DataError(
            f'part: the body hangs on "{joint["name"]}", a {joint["kind"]}; only free bodies are cut'
        )
    placed = {**tables[first], "name": root, "joint": root}
    made["frame"] = [placed if table["name"] == root else table for table in made["frame"]]
    others = [table for table in made["joint"] if table["name"] not in (root, joint["name"])]
    made["joint"] = [{**joint, "name": root}, *others]


def _path(tables: Mapping[str, Table], frame: str) -> list[str]:
    """The frames from "root" to this one."""
    found = [frame]
    while found[0] != _ROOT:
        if found[0] not in tables:
            raise DataError(f'part: there is no frame "{found[0]}". {did_you_mean(found[0], tables)}')
        found.insert(0, tables[found[0]]["parent"])
    return found


def _frames_of(sensor: Table, document: Document) -> list[str]:
    """The frames that a sensor sits on, ends at, or whose joint it reads."""
    if "joint" in sensor:
        return [table["name"] for table in document["frame"] if table.get("joint") == sensor["joint"]]
    return [sensor[key] for key in ("frame", "frame_a", "frame_b") if key in sensor]


def _common_root(document: Document, frames: list[str]) -> str:
    """The last frame that all these hang on, if the body moves freely; else "root"."""
    tables = {table["name"]: table for table in document["frame"]}
    paths = [_path(tables, frame) for frame in frames]
    shared = [steps[0] for steps in zip(*paths, strict=False) if len(set(steps)) == 1]
    if len(shared) < 2:
        return _ROOT
    kinds = {table["name"]: table["kind"] for table in document["joint"]}
    return shared[-1] if kinds.get(tables[shared[1]].get("joint", "")) in _MOVES_FREELY else _ROOT


def _stays(table: Table, frames: set[str], joints: set[Any]) -> bool:
    return all(table[key] in frames for key in ("frame", "frame_a", "frame_b") if key in table) and (
        "joint" not in table or table["joint"] in joints
    )


def without_unused_parameters(document: Document) -> Document:
    """The document without parameters that no other table names."""
    if "parameters" not in document:
        return document
    used = set(_names(value for key, value in document.items() if key not in ("parameters", "description")))
    left = {name: value for name, value in document["parameters"].items() if name in used}
    return {**document, "parameters": left}


def _names(value: Any) -> Iterable[str]:
    """All names that stand in texts."""
    if isinstance(value, str):
        yield from _NAME.findall(value)
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _names(part)
    elif isinstance(value, Iterable):
        for part in value:
            yield from _names(part)
