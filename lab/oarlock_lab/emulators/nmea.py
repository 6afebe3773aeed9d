"""Emulates a GPS receiver: sentences RMC and VTG ten times a second, by UDP, TCP or serial line.

Source: E. S. Raymond, "NMEA Revealed" (gpsd.io). The receiver moves straight on, faster and slower once a stroke.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring, on_the_way

RATE_HZ = 10.0
STARTED = datetime.datetime(2026, 6, 1, 8, 0, 0, tzinfo=datetime.UTC)
_UNIT = "gps"
_FROM_DEG = (48.1173, 11.516667)
_COURSE_DEG = 84.4
_MEAN_M_S, _SURGE_M_S, _SURGE_HZ = 4.6, 0.7, 0.4
_EARTH_M = 6_371_000.0
_KNOTS, _KMH = 3600.0 / 1852.0, 3.6


@dataclass(frozen=True)
class Fix:
    """What the receiver knows at a time.

    Args:
        epoch_s: s since 1970.
        latitude_deg, longitude_deg: positive to north and east.
        speed_m_s, course_deg: over ground.
    """

    epoch_s: float
    latitude_deg: float
    longitude_deg: float
    speed_m_s: float
    course_deg: float


def fix(time_s: float) -> Fix:
    """The fix at a time since the start."""
    turns = 2.0 * math.pi * _SURGE_HZ
    way_m = _MEAN_M_S * time_s + _SURGE_M_S / turns * (1.0 - math.cos(turns * time_s))
    course = math.radians(_COURSE_DEG)
    north_deg = math.degrees(way_m * math.cos(course) / _EARTH_M)
    east_deg = math.degrees(way_m * math.sin(course) / _EARTH_M / math.cos(math.radians(_FROM_DEG[0])))
    speed_m_s = _MEAN_M_S + _SURGE_M_S * math.sin(turns * time_s)
    place = (_FROM_DEG[0] + north_deg, _FROM_DEG[1] + east_deg)
    return Fix(STARTED.timestamp() + time_s, *place, speed_m_s, _COURSE_DEG)


def rmc(at: Fix) -> bytes:
    """Time, place, speed and course."""
    moment = datetime.datetime.fromtimestamp(round(at.epoch_s, 2), datetime.UTC)
    time = f"{moment:%H%M%S}.{moment.microsecond // 10_000:02d}"
    places = (_minutes(at.latitude_deg, 2), "NS"[at.latitude_deg < 0.0], _minutes(at.longitude_deg, 3))
    told = ("GNRMC", time, "A", *places, "EW"[at.longitude_deg < 0.0], f"{_KNOTS * at.speed_m_s:.3f}")
    return _sentence(",".join((*told, f"{at.course_deg:05.1f}", f"{moment:%d%m%y}", "", "", "A")))


def vtg(at: Fix) -> bytes:
    """Speed and course."""
    knots, kmh = _KNOTS * at.speed_m_s, _KMH * at.speed_m_s
    return _sentence(f"GNVTG,{at.course_deg:05.1f},T,,M,{knots:.3f},N,{kmh:.3f},K,A")


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """Both sentences of each fix together."""
    moments = ((number / RATE_HZ, None) for number in count())
    for due_s, time_s, _ in on_the_way(emulated, moments):
        at = fix(time_s)
        yield DeviceMessage(due_s, _UNIT, rmc(at) + vtg(at))


def wiring(emulated: Emulated) -> Wiring:
    """It feeds no sensor."""
    return Wiring("nmea", senders(emulated.place, "gps", [_UNIT]), {})


async def emulate(emulated: Emulated) -> None:
    """Send until the recording's time is over, or it is cancelled."""
    await carry(emulated, [_UNIT], messages(emulated))


def _minutes(degrees: float, digits: int) -> str:
    """Degrees and minutes with five decimals."""
    whole, rest = divmod(round(abs(degrees) * 60.0, 5), 60.0)
    return f"{int(whole):0{digits}d}{rest:08.5f}"


def _sentence(body: str) -> bytes:
    checksum = 0
    for byte in body.encode("ascii"):
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n".encode("ascii")
