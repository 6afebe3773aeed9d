"""Decodes x-IMU3: binary, text, multiplexed and JSON messages by serial port, TCP or UDP.

Sources: x-io Technologies, x-IMU3 User Manual, "Communication protocol"; the vendor's code for senders
(xioTechnologies/x-IMU3-Device on GitHub, MIT). Linear and earth acceleration come with a quaternion before them
from older units, without from newer ones: both are read. Clocks of units in one network share their zero.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType

from oarlock.formats.devices.ximu3_messages import LARGEST_US, text_arguments, unstuffed
from oarlock.live.decoders.messages import MessageDecoder
from oarlock.live.decoders.quantities import are_sound, from_gravities, quat_from_roll_pitch_yaw, radians
from oarlock.live.reading import Reading, Value

Numbers = tuple[float, ...]
_BINARY = 0x80
_SAMPLES_HZ: Mapping[str, float] = MappingProxyType({"I": 400.0, "H": 3200.0, "M": 20.0})
"""Nominal rates of the samples; a divisor n makes each message the mean of n of them, with the stamp of the last."""
_MOST_CHANNELS = 2
"""Of a multiplexed stream in a multiplexed stream; deeper is damage."""
_TEXTS = MappingProxyType({"N": "notification", "F": "error", "C": "timecode", "S": "serial_accessory"})


def decoder(
    *,
    inertial_divisor: int = 1,
    high_g_divisor: int = 1,
    magnetometer_divisor: int = 1,
    datagrams: bool = False,
) -> MessageDecoder:
    """A decoder of one unit, or of a multiplexed stream: the channel is the reading's device.

    Args:
        inertial_divisor: the unit's setting `inertial_message_rate_divisor`: clocks become those of the mean sample.
        high_g_divisor: `high_g_accelerometer_message_rate_divisor`.
        magnetometer_divisor: `magnetometer_message_rate_divisor`.
        datagrams: each call has whole messages, as in UDP.
    """
    divisors = {"I": inertial_divisor, "H": high_g_divisor, "M": magnetometer_divisor}
    earlier_s = {kind: 0.5 * (n - 1) / _SAMPLES_HZ[kind] for kind, n in divisors.items()}
    return MessageDecoder(lambda message: _readings(message, earlier_s), datagrams=datagrams)


def _acceleration(name: str) -> Callable[[Numbers], dict[str, Value]]:
    def read(n: Numbers) -> dict[str, Value]:
        quat: dict[str, Value] = {"quat_wxyz": n[:4]} if len(n) == 7 else {}
        return {**quat, name: from_gravities(n[-3:])}

    return read


def _named(*names: str) -> Callable[[Numbers], dict[str, Value]]:
    return lambda n: dict(zip(names, n, strict=True))


_NUMBERS: Mapping[str, tuple[tuple[int, ...], Callable[[Numbers], dict[str, Value]]]] = MappingProxyType(
    {
        "I": ((6,), lambda n: {"gyro_rad_s": radians(n[:3]), "accel_m_s2": from_gravities(n[3:])}),
        "M": ((3,), lambda n: {"mag_arbitrary": n}),
        "H": ((3,), lambda n: {"high_g_accel_m_s2": from_gravities(n)}),
        "Q": ((4,), lambda n: {"quat_wxyz": n}),
        "R": ((9,), lambda n: {"matrix_by_rows": n}),
        "A": ((3,), lambda n: {"quat_wxyz": quat_from_roll_pitch_yaw(n)}),
        "L": ((3, 7), _acceleration("linear_accel_m_s2")),
        "E": ((3, 7), _acceleration("earth_accel_m_s2")),
        "U": ((4,), _named("initialising", "gyro_recovery", "accel_recovery", "mag_recovery")),
        "T": ((1,), _named("temperature_deg_c")),
        "B": ((3,), _named("battery_percent", "battery_v", "charging")),
        "W": ((2,), _named("rssi_percent", "rssi_dbm")),
        "Y": ((1,), _named("sync_edge")),
        "O": ((0, 1), lambda n: {"button": n[0] if n else 1.0}),
    }
)
"""Letter -> how many numbers it may have, and what they are."""


def _readings(message: bytes, earlier_s: Mapping[str, float]) -> list[Reading] | None:
    channel = b""
    while message[:1] == b"^" and len(channel) < _MOST_CHANNELS:
        channel, message = channel + message[1:2], message[2:]
    device = channel.decode("latin-1")
    if message.startswith(b"{"):
        return _command(device, message)
    found = _binary(message) if message and message[0] >= _BINARY else _text(message)
    if found is None or not are_sound(found[2]):
        return None
    kind, time_us, values = found
    return [Reading(device, time_us / 1e6 - earlier_s.get(kind, 0.0), values)]


def _command(device: str, message: bytes) -> list[Reading] | None:
    """What a unit acknowledges, as text: settings, answers to a ping, errors."""
    try:
        json.loads(message)
        return [Reading(device, None, {"command": message.strip().decode()})]
    except (ValueError, RecursionError):
        return None


def _binary(message: bytes) -> tuple[str, int, dict[str, Value]] | None:
    plain = unstuffed(message)
    # A stuffed first byte may stand for one that begins no message.
    if plain is None or len(plain) < 9 or plain[0] < _BINARY:
        return None
    kind, time_us = chr(plain[0] - _BINARY), int.from_bytes(plain[1:9], "little")
    body = plain[9:]
    if kind in _TEXTS:
        return (
            (kind, time_us, {_TEXTS[kind]: body.decode("utf-8", "replace")}) if time_us < LARGEST_US else None
        )
    if len(body) % 4:
        return None
    return _of_numbers(kind, time_us, struct.unpack(f"<{len(body) // 4}f", body))


def _text(message: bytes) -> tuple[str, int, dict[str, Value]] | None:
    kind = message[:1].decode("latin-1")
    if kind in _TEXTS:
        stamp, _, text = message.rstrip(b"\r").partition(b",")[2].partition(b",")
        known = stamp.isdigit() and len(stamp) < 17 and int(stamp) < LARGEST_US
        return (kind, int(stamp), {_TEXTS[kind]: text.decode("utf-8", "replace")}) if known else None
    found = text_arguments(message) if message[1:2] == b"," else None
    return None if found is None else _of_numbers(kind, found[0], tuple(found[1]))


def _of_numbers(kind: str, time_us: int, numbers: Numbers) -> tuple[str, int, dict[str, Value]] | None:
    widths, read = _NUMBERS.get(kind, ((), None))
    if read is None or len(numbers) not in widths or time_us >= LARGEST_US:
        return None
    return kind, time_us, read(numbers)
