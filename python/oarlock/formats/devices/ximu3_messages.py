"""Decodes the byte stream of an x-IMU3, as its data logger writes it to a .ximu3 file.

Sources: x-io Technologies, x-IMU3 User Manual, sections "Communication protocol" and "Data logger"; the decoder of the
vendor's API (xioTechnologies/x-IMU3-Software on GitHub, MIT).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from oarlock.formats.devices.ximu3_unit import COLUMNS, MessageTable, Ximu3Unit
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes

_END, _ESCAPE = b"\n", b"\xdb"
_ESCAPED_END, _ESCAPED_ESCAPE = b"\xdb\xdc", b"\xdb\xdd"
_BINARY = 0x80
_IDS = {"Inertial": "I", "Magnetometer": "M", "Quaternion": "Q"}
_KINDS = {ord(letter): kind for kind, letter in _IDS.items()}
_OTHERS = frozenset(b"RALEUHTBWYCOSNF")
LARGEST_US = 2**53


@dataclass
class _ChannelMessages:
    """What came from one unit: its own stream, or a channel of a multiplexed one."""

    binary: dict[str, list[bytes]] = field(default_factory=lambda: {kind: [] for kind in COLUMNS})
    text: dict[str, list[bytes]] = field(default_factory=lambda: {kind: [] for kind in COLUMNS})
    commands: dict[str, object] = field(default_factory=dict)
    damaged: int = 0


def file_units(file: Path) -> list[Ximu3Unit]:
    """The units of a .ximu3 file: one, or one for each channel of a multiplexed stream.

    A message that cannot be decoded is left out and counted, as the vendor's software does.

    Raises:
        DataError: the file cannot be read or has no message that can be decoded.
    """
    content = read_bytes(file)
    lines = content.split(_END)
    channels: dict[bytes, _ChannelMessages] = {}
    for line in lines[:-1]:
        _sort(line, channels, b"")
    units = [_unit(file, key, channel) for key, channel in sorted(channels.items())]
    units = [unit for unit in units if unit.messages or unit.commands]
    if not units:
        raise DataError(f"{file}: has no message of an x-IMU3. Is it a file of its data logger (.ximu3)?")
    if lines[-1]:
        units[0].notes.append(f"{file.name}: is cut off in its last message.")
    return units


def _sort(line: bytes, channels: dict[bytes, _ChannelMessages], key: bytes) -> None:
    """Puts one message, without its termination, to the others of its kind."""
    while line[:1] == b"^" and len(line) > 1:
        key, line = key + line[1:2], line[2:]
    channel = channels.setdefault(key, _ChannelMessages())
    first = line[0] if line else 0
    if first == ord("{"):
        _command(line, channel)
    elif kind := _KINDS.get(first & ~_BINARY):
        _keep(line, kind, channel)
    elif first & ~_BINARY not in _OTHERS:
        channel.damaged += 1


def _command(line: bytes, channel: _ChannelMessages) -> None:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        channel.damaged += 1
        return
    # In keys, capitals and characters other than letters and digits do not count.
    channel.commands |= {"".join(filter(str.isalnum, key)).lower(): value for key, value in found.items()}


def _keep(line: bytes, kind: str, channel: _ChannelMessages) -> None:
    if line[0] < _BINARY:
        channel.text[kind].append(line)
        return
    plain = unstuffed(line)
    if plain is not None and len(plain) == 9 + 4 * len(COLUMNS[kind]):
        channel.binary[kind].append(plain)
    else:
        channel.damaged += 1


def unstuffed(line: bytes, end: bytes = _END) -> bytes | None:
    """A message with the bytes that stand for its end and for the escape byte put back; None if an escape is none.

    Args:
        line: the message without its end.
        end: the byte that ends messages: SLIP (RFC 1055) has another, and the same escapes.
    """
    if _ESCAPE not in line:
        return line
    if line.count(_ESCAPE) != sum(line.count(pair) for pair in (_ESCAPED_END, _ESCAPED_ESCAPE)):
        return None
    return line.replace(_ESCAPED_END, end).replace(_ESCAPED_ESCAPE, _ESCAPE)


def _unit(file: Path, key: bytes, channel: _ChannelMessages) -> Ximu3Unit:
    messages = {kind: found for kind in COLUMNS if (found := _messages(kind, channel)) is not None}
    ping = channel.commands.get("ping")
    told = ping if isinstance(ping, dict) else {}
    label = str(told.get("name") or channel.commands.get("devicename") or file.stem)
    serial = str(told.get("sn") or channel.commands.get("serialnumber") or key.hex())
    unit = Ximu3Unit(str(file), label, serial, messages, channel.commands)
    if channel.damaged:
        unit.notes.append(f"{label}: {channel.damaged} messages are damaged and were left out.")
    return unit


def _messages(kind: str, channel: _ChannelMessages) -> MessageTable | None:
    """A unit sends text or binary messages; if the setting was changed, the file has both."""
    width = len(COLUMNS[kind])
    form = np.dtype([("id", "u1"), ("time_us", "<u8"), ("values", "<f4", (width,))])
    binary = np.frombuffer(b"".join(channel.binary[kind]), form)
    kept = binary[(binary["time_us"] < LARGEST_US) & np.isfinite(binary["values"]).all(axis=1)]
    text = list(_plain(channel.text[kind], width))
    channel.damaged += len(binary) - len(kept) + len(channel.text[kind]) - len(text)
    time_us = np.concatenate([kept["time_us"].astype(np.int64), np.array([t for t, _ in text], np.int64)])
    values = np.concatenate(
        [kept["values"].astype(np.float64), np.array([v for _, v in text]).reshape(-1, width)]
    )
    return MessageTable(time_us, values) if time_us.size else None


def _plain(lines: list[bytes], width: int) -> Iterator[tuple[int, list[float]]]:
    for line in lines:
        found = text_arguments(line)
        if found is not None and len(found[1]) == width and np.isfinite(found[1]).all():
            yield found


def text_arguments(line: bytes) -> tuple[int, list[float]] | None:
    """The microseconds and the numbers of a text message; None if it has others."""
    cells = line.rstrip(b"\r").split(b",")
    try:
        time_us, values = int(cells[1]), [float(cell) for cell in cells[2:]]
    except (ValueError, IndexError):
        return None
    return (time_us, values) if 0 <= time_us < LARGEST_US else None
