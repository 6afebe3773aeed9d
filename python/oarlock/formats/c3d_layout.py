"""Whether a C3D file can hold what it announces, asked before a library believes it.

A damaged byte may announce gigabytes of points or parameters, for which the library would make room.

Source: The C3D File Format, a technical user guide (Motion Lab Systems 2021), header, parameter and group sections.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path

from oarlock.storage.errors import DataError

_BLOCK = 512
_KEY = 0x50
_ORDERS = {84: "<", 85: "<", 86: ">"}
"""By processor: Intel, DEC, MIPS."""
_COUNTS = ("POINT:USED", "POINT:FRAMES", "ANALOG:USED", "TRIAL:ACTUAL_START_FIELD", "TRIAL:ACTUAL_END_FIELD")
_NUMBERS = (*_COUNTS, "POINT:SCALE", "POINT:RATE", "POINT:DATA_START", "ANALOG:RATE", "ANALOG:GEN_SCALE")
"""Where one is of no elements in several dimensions, ezc3d takes the first and ends the process."""
_COORDINATES_AND_RESIDUAL = 4
_SHORTEST_WORD = 2


@dataclass(frozen=True)
class _Entry:
    """A parameter: number of its group, name, bytes of one element, and where its elements stand."""

    group: int
    name: str
    width: int
    dimensions: tuple[int, ...]
    start: int


def check_layout(raw: bytes, file: Path) -> None:
    """Refuse a file whose header or parameters announce more than it holds.

    Raises:
        DataError: no C3D file, cut off, or damaged; says where.
    """
    if len(raw) < _BLOCK or raw[1] != _KEY or raw[0] < 1:
        raise DataError(
            f"{file}: is no C3D file, or is damaged (its second byte is 80 and it has 512 or more)"
        )
    start = (raw[0] - 1) * _BLOCK
    if start + 4 > len(raw):
        raise _damaged(file, f"its parameters stand at byte {start}, the file ends at {len(raw)}")
    order = _ORDERS.get(raw[start + 3])
    if order is None:
        raise _damaged(file, f"byte {start + 3} says processor {raw[start + 3]}; expected 84, 85 or 86")
    try:
        _check_counts(raw, order, _counts(raw, order, start + 4, file), file)
    except (struct.error, IndexError):
        raise _damaged(file, "its parameters run beyond its end") from None


def _check_counts(raw: bytes, order: str, told: dict[str, int], file: Path) -> None:
    points, analog, first, last = struct.unpack_from(f"{order}4H", raw, 2)
    ends = told.get("TRIAL:ACTUAL_START_FIELD", first), told.get("TRIAL:ACTUAL_END_FIELD", last)
    frames = max(last - first + 1, ends[1] - ends[0] + 1, told.get("POINT:FRAMES", 0))
    words = _COORDINATES_AND_RESIDUAL * max(points, told.get("POINT:USED", 0))
    words += max(analog, told.get("ANALOG:USED", 0))
    if frames * words * _SHORTEST_WORD > len(raw):
        raise _damaged(
            file,
            f"it announces {frames} frames of {words} numbers each, but has {len(raw)} bytes; was it cut off?",
        )


def _counts(raw: bytes, order: str, start: int, file: Path) -> dict[str, int]:
    """Those of `_COUNTS` that stand there; of two 16-bit words the lower one comes first."""
    groups: dict[int, str] = {}
    found: dict[str, int] = {}
    for entry in _entries(raw, order, start, groups, file):
        name = f"{groups.get(entry.group, '')}:{entry.name}"
        if prod(entry.dimensions) == 0 and (name in _NUMBERS or entry.name == "USED"):
            raise _damaged(file, f"the parameter {name} holds no number")
        if name in _COUNTS and entry.width == 2:
            words = struct.unpack_from(f"{order}{min(2, prod(entry.dimensions))}H", raw, entry.start)
            found[name] = sum(word << (16 * k) for k, word in enumerate(words))
        elif name in _COUNTS and entry.width == 4:
            (value,) = struct.unpack_from(f"{order}f", raw, entry.start)
            found[name] = int(value) if 0.0 <= value < 1e9 else 0
    return found


def _entries(raw: bytes, order: str, start: int, groups: dict[int, str], file: Path) -> Iterator[_Entry]:
    """The parameters in turn; names of groups are noted in `groups`."""
    here = start
    while here + 2 <= len(raw):
        length, group = struct.unpack_from("bb", raw, here)
        if not length or not group:
            return
        behind_name = here + 2 + abs(length)
        name = raw[here + 2 : behind_name].decode("latin-1").upper()
        (step,) = struct.unpack_from(f"{order}h", raw, behind_name)
        if group < 0:
            groups[-group] = name
        else:
            yield _entry(raw, behind_name + 2, group, name, file)
        if step == 0:
            return
        if step < 2:
            raise _damaged(file, f'the entry "{name[:20]}" at byte {here} leads {step} bytes on')
        here = behind_name + step


def _entry(raw: bytes, here: int, group: int, name: str, file: Path) -> _Entry:
    width, count = struct.unpack_from("bB", raw, here)
    dimensions = tuple(raw[here + 2 : here + 2 + count])
    start = here + 2 + count
    if abs(width) not in (1, 2, 4) or count > 7 or start + abs(width) * prod(dimensions) > len(raw):
        raise _damaged(
            file, f'the parameter "{name[:20]}" announces {dimensions} numbers of {abs(width)} bytes'
        )
    return _Entry(group, name, width, dimensions, start)


def _damaged(file: Path, why: str) -> DataError:
    return DataError(f"{file}: is no C3D file, or is damaged: {why}")
