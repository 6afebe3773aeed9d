"""Changes of model files as documents, for `Model.with_...`, `Model.without` and files that extend others."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import toml_text

if TYPE_CHECKING:
    from oarlock._core import Model

Document = dict[str, Any]
Table = Mapping[str, Any]

NAMED = ("joint", "frame", "sensor", "closure", "base_acceleration")
"""Lists of tables whose entries have names."""
_PLACE = ("replace", "before", "after")
"""Keys of a change that say where and how it is made, and do not stay in the model."""


def document_of(model: Model) -> Document:
    """The model file as a document, one's own to change."""
    return tomllib.loads(model.text)


def model_of(document: Table, model: Model) -> Model:
    """The model of a changed document, with the path and the values of parameters of the one that it was made from.

    Raises:
        ModelError: the changed file is wrong.
    """
    known = document.get("parameters", {})
    values = {name: value for name, value in model.parameters.items() if name in known}
    return type(model).from_toml(toml_text(document), model.path, values)


def moving_frame(name: str, parent: str, axis: str, joint: str, **more: object) -> Document:
    """The table of a frame at its parent's origin that a joint rotates about, or moves along, an axis."""
    still = {"translation": [0, 0, 0]}
    return {"name": name, "parent": parent, "transform": still, "axis": axis, "joint": joint, **more}


def with_parameters(model: Model, values: Mapping[str, float]) -> Model:
    """See `Model.with_parameters`."""
    return type(model).from_toml(model.text, model.path, model.parameters | dict(values)) if values else model


def with_tables(model: Model, changes: Table) -> Model:
    """See `Model.with_tables`."""
    return model_of(merged(document_of(model), changes), model)


def without(model: Model, names: Mapping[str, Iterable[str]]) -> Model:
    """See `Model.without`."""
    document = document_of(model)
    for kind, some in names.items():
        _check_names(document, kind, some)
    frames = _carried(document, set(names.get("joint", ())), set(names.get("frame", ())))
    joints = set(names.get("joint", ())) | _left_still(document, frames)
    stays: dict[str, Callable[[Table], bool]] = {
        "joint": lambda table: table["name"] not in joints,
        "frame": lambda table: table["name"] not in frames,
        "sensor": lambda table: table.get("frame") not in frames and table.get("joint") not in joints,
        "closure": lambda table: not {table["frame_a"], table["frame_b"]} & frames,
        "base_acceleration": lambda table: True,
    }
    for kind in NAMED:
        gone, keep = set(names.get(kind, ())), stays[kind]
        left = [table for table in document.pop(kind, ()) if table["name"] not in gone and keep(table)]
        document |= {kind: left} if left else {}
    return model_of(document, model)


def _carried(document: Document, joints: set[str], frames: set[str]) -> set[str]:
    """These frames, those that these joints move, and all that hangs on any of them."""
    tables = document.get("frame", ())
    found = frames | {table["name"] for table in tables if table.get("joint") in joints}
    while more := {table["name"] for table in tables if table.get("parent") in found} - found:
        found |= more
    return found


def _left_still(document: Document, frames: set[str]) -> set[str]:
    """Joints that move nothing once these frames are gone."""
    moved = [table for table in document.get("frame", ()) if "joint" in table]
    moving = [(table["joint"], table["name"] in frames) for table in moved]
    return {joint for joint, gone in moving if gone} - {joint for joint, gone in moving if not gone}


def merged(base: Table, changes: Table) -> Document:
    """A document with what another one changes.

    Keys of `[world]`, `[process]` and the like replace the base's, parameters change key by key. Tables of joints,
    frames, sensors, closures and base accelerations change those of their name, key by key, or wholly with
    `replace = true`; new ones stand at the end, or where `before` or `after` says. `remove` names by kind what goes
    first.

    Raises:
        DataError: a name to remove, or to stand beside, is not there; a table is no table, or has no name.
    """
    for part in (base, changes):
        _check_shapes(part)
    document: Document = copy.deepcopy(dict(base))
    for kind, names in changes.get("remove", {}).items():
        _remove(document, kind, names)
    for key, value in changes.items():
        if key in NAMED:
            for table in value:
                _put(document.setdefault(key, []), key, table)
        elif key == "parameters":
            _change_parameters(document.setdefault(key, {}), value)
        elif key not in ("remove", "extends"):
            both = isinstance(value, Mapping) and isinstance(document.get(key), Mapping)
            document[key] = {**document[key], **value} if both else copy.deepcopy(value)
    return document


def _check_shapes(document: Table) -> None:
    for kind in NAMED:
        tables = document.get(kind, [])
        if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
            raise DataError(f"{kind}: expected tables, [[{kind}]]")
        if not all(isinstance(table.get("name"), str) for table in tables):
            raise DataError(f"a [[{kind}]] has no name; what changes the model is found by its name")
    for key in ("parameters", "remove"):
        if not isinstance(document.get(key, {}), Mapping):
            raise DataError(f"{key}: expected a table, [{key}]")
    for kind, names in document.get("remove", {}).items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise DataError(f'remove.{kind}: expected names, ["a", "b"]')


def _remove(document: Document, kind: str, names: Iterable[str]) -> None:
    kinds = [key for key, value in document.items() if key in NAMED or isinstance(value, Mapping)]
    if kind not in kinds:
        raise DataError(f"remove.{kind}: the model has no such tables. {did_you_mean(kind, kinds)}")
    names = list(names)
    _check_names(document, kind, names)
    tables = document.pop(kind)
    if isinstance(tables, Mapping):
        document[kind] = {name: value for name, value in tables.items() if name not in names}
    elif left := [table for table in tables if table["name"] not in names]:
        document[kind] = left


def _check_names(document: Document, kind: str, names: Iterable[str]) -> None:
    tables = document.get(kind, ())
    known = list(tables) if isinstance(tables, Mapping) else [table["name"] for table in tables]
    for name in names:
        if name not in known:
            raise DataError(f'the model has no {kind} "{name}" to remove. {did_you_mean(name, known)}')


def _put(tables: list[Document], kind: str, change: Table) -> None:
    own = {key: copy.deepcopy(value) for key, value in change.items() if key not in _PLACE}
    names = [table["name"] for table in tables]
    there = names.index(own["name"]) if own["name"] in names else None
    beside = [key for key in ("before", "after") if key in change]
    if there is not None and not beside:
        tables[there] = own if change.get("replace") else {**tables[there], **own}
        return
    if there is not None:
        old = tables.pop(there)
        names.pop(there)
        own = own if change.get("replace") else {**old, **own}
    for key in beside:
        if change[key] not in names:
            raise DataError(
                f'{kind} "{own["name"]}": {key}: there is no {kind} "{change[key]}". '
                f"{did_you_mean(str(change[key]), names)}"
            )
    place = names.index(change[beside[0]]) + (beside[0] == "after") if beside else len(tables)
    tables.insert(place, own)


def _change_parameters(known: Document, changes: Table) -> None:
    for name, value in changes.items():
        old = known.get(name)
        if isinstance(old, Mapping):
            value = {**old, **value} if isinstance(value, Mapping) else {**old, "default": value}
        known[name] = copy.deepcopy(value)
