"""Fields that are there if a bit of the message's flags is set, as Bluetooth's fitness services have them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from oarlock.live.decoders.fields import Field, width_of

Flagged = tuple[int, tuple[Field, ...]]
"""A bit of the flags and the fields that it announces."""


def announced(table: Iterable[Flagged], flags: int) -> list[Field]:
    """The fields of a message with these flags, in their order."""
    return [field for bit, fields in table if flags >> bit & 1 for field in fields]


def flags_of(data: bytes) -> int:
    """The 16 bits that such a message begins with."""
    return int.from_bytes(data[:2], "little")


def fitting(variants: Sequence[list[Field]], data: bytes) -> list[Field] | None:
    """The first of the variants that the data are long enough for; None if they are too short for all."""
    return next((fields for fields in variants if width_of(fields) <= len(data)), None)
