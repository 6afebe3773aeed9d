"""Readable names of the rows of state and measurement vectors, for descriptions of a model.

A row's name is `owner.part` or `owner`: `trunk.velocity`, `shoulder.rx.velocity`, `back.gyro_x`, `seat`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby


@dataclass(frozen=True)
class RowBlock:
    """Neighbouring rows of the same kind."""

    kind: str
    rows: str
    count: int


def rows_of(owner: str, row_names: Sequence[str]) -> str:
    """The rows of one joint, sensor or closure: `7`, `0-8` or `0, 12, 24`; empty without any."""
    return _ranges([row for row, name in enumerate(row_names) if _split(name)[0] == owner])


def parts_of(owner: str, row_names: Sequence[str]) -> tuple[str, ...]:
    """What the rows of `owner` hold: `("gyro_x", "gyro_y", ...)`; an empty text for the thing itself."""
    return tuple(part for name, part in map(_split, row_names) if name == owner)


def quantities(parts: Iterable[str]) -> str:
    """`gyro_x, gyro_y, gyro_z, mag_y` as `gyro xyz, mag y`."""
    found: dict[str, str] = {}
    for part in parts:
        quantity, _, axis = part.rpartition("_")
        if axis in ("x", "y", "z"):
            found[quantity] = found.get(quantity, "") + axis
        elif part:
            found[part] = ""
    return ", ".join(f"{name.replace('_', ' ') or 'point'} {axes}".strip() for name, axes in found.items())


def blocks(row_names: Sequence[str], kinds: dict[str, str]) -> tuple[RowBlock, ...]:
    """The layout as few blocks; `kinds` names the kind of an owner, else the quantity or the owner does."""
    numbered = [(_kind(name, kinds), row) for row, name in enumerate(row_names)]
    found = []
    for kind, group in groupby(numbered, key=lambda item: item[0]):
        rows = [row for _, row in group]
        found.append(RowBlock(kind, _ranges(rows), len(rows)))
    return tuple(found)


def _kind(row_name: str, kinds: dict[str, str]) -> str:
    owner, part = _split(row_name)
    quantity = part.rpartition("_")[0] if part.endswith(("_x", "_y", "_z")) else part
    # biases belong to a sensor, whose name a joint may share
    if quantity.endswith("_bias"):
        return "sensor biases"
    if quantity.endswith("_error"):
        return "slow errors of orientations"
    kind = kinds.get(owner)
    if kind is None:
        return quantity.replace("_", " ") or owner
    rate = part.rpartition(".")[2]
    return f"{rate} of {kind}" if rate in ("velocity", "acceleration") else kind


def _split(row_name: str) -> tuple[str, str]:
    owner, _, part = row_name.partition(".")
    return owner, part


def _ranges(rows: Sequence[int]) -> str:
    found = []
    # rows of one run differ from their place in the list by the same amount
    for _, run in groupby(enumerate(rows), key=lambda item: item[1] - item[0]):
        numbers = [row for _, row in run]
        found.append(str(numbers[0]) if len(numbers) == 1 else f"{numbers[0]}-{numbers[-1]}")
    return ", ".join(found)
