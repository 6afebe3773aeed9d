"""Decodes x-io NGIMU: OSC by UDP, or in SLIP frames by a serial port.

Source: the vendor's software, NgimuApi (xioTechnologies/NGIMU-Software-Public on GitHub). The time tag of a bundle
is the time of its samples, in seconds since 1970 if a synchronisation master runs, else since the unit's start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from oarlock.live.decoders.messages import MessageDecoder
from oarlock.live.decoders.osc import OscMessage, seconds
from oarlock.live.decoders.osc_readings import osc_decoder, value_of
from oarlock.live.decoders.quantities import are_sound, from_gravities, radians
from oarlock.live.reading import Reading, Value

Numbers = tuple[float, ...]


def decoder(*, datagrams: bool = False) -> MessageDecoder:
    """A decoder of one unit.

    Args:
        datagrams: each call has one packet, as in UDP; else packets come in SLIP frames, as on the serial port.
    """
    return osc_decoder(_readings, datagrams=datagrams)


def _sensors(n: Numbers) -> dict[str, Value]:
    return {
        "gyro_rad_s": radians(n[:3]),
        "accel_m_s2": from_gravities(n[3:6]),
        "mag_ut": n[6:9],
        "pressure_hpa": n[9],
    }


def _world_from_sensor(n: Numbers) -> dict[str, Value]:
    w, x, y, z = n
    return {"quat_wxyz": (w, -x, -y, -z)}


_KNOWN: Mapping[str, tuple[int, Callable[[Numbers], dict[str, Value]]]] = MappingProxyType(
    {
        "/sensors": (10, _sensors),
        "/quaternion": (4, _world_from_sensor),
        "/linear": (3, lambda n: {"linear_accel_m_s2": from_gravities(n)}),
        "/earth": (3, lambda n: {"earth_accel_m_s2": from_gravities(n)}),
    }
)
"""Address -> how many arguments, and what they are. Arguments of others are passed on by their address, as sent."""


def _readings(found: list[OscMessage]) -> list[Reading] | None:
    readings: list[Reading] = []
    for message in found:
        values = _values(message)
        if values is None or not are_sound(values):
            return None
        if values:
            readings.append(Reading("", seconds(message.tag), values))
    return readings


def _values(message: OscMessage) -> dict[str, Value] | None:
    numbers = tuple(float(one) for one in message.arguments if isinstance(one, int | float))
    if message.address in _KNOWN:
        width, read = _KNOWN[message.address]
        return read(numbers) if len(numbers) == len(message.arguments) == width else None
    if message.address == "/battery":
        return {"battery_percent": numbers[0]} if numbers else None
    value = value_of(message.arguments)
    return {} if value is None else {message.address.strip("/").replace("/", "_"): value}
