"""Numbers of a Bluetooth characteristic, from a table of fields; for the decoders of fitness machines."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Field(NamedTuple):
    """A little-endian integer.

    Args:
        name: of the value, with its unit; "" for one that is skipped.
        width: bytes.
        scale: the value of one count.
        absent: the count that means "not available".
        signed: two's complement.
    """

    name: str
    width: int
    scale: float = 1.0
    absent: int | None = None
    signed: bool = False


def width_of(fields: Iterable[Field]) -> int:
    """The bytes that the fields occupy."""
    return sum(field.width for field in fields)


def values_of(fields: Iterable[Field], data: bytes) -> dict[str, float]:
    """The values of fields that follow each other from the first byte on; bytes behind the last are not read."""
    values: dict[str, float] = {}
    at = 0
    for field in fields:
        count = int.from_bytes(data[at : at + field.width], "little", signed=field.signed)
        at += field.width
        if field.name and count != field.absent:
            values[field.name] = scaled(count, field.scale)
    return values


def scaled(count: int, scale: float) -> float:
    """``count * scale``; the nearest number to the decimal one if the scale is one over an integer, such as 0.01."""
    per_unit = round(1.0 / scale)
    return count / per_unit if abs(per_unit * scale - 1.0) < 1e-12 else count * scale


def number(channel: str) -> int | None:
    """The 16 bits that tell a vendor's characteristics apart: `"CE060031-43E5-..."`, `"CE060031"`, `"0x0031"` -> 0x31.

    None if the text is no UUID.
    """
    digits = channel.strip().partition("-")[0].lower().removeprefix("0x")[-4:]
    try:
        return int(digits, 16)
    except ValueError:
        return None
