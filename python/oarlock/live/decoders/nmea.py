"""Decodes NMEA 0183 sentences of GPS receivers: RMC (time, place, speed) and VTG (speed), from any talker.

Sources: E. S. Raymond, "NMEA Revealed" (gpsd.io). A sentence without the right checksum is damaged; sentences of
other kinds give no reading. The clock is the epoch of the fix, seconds since 1970: the sentence arrives later. VTG
has no time: it is the device `vtg`.
"""

from __future__ import annotations

import datetime
from functools import reduce
from operator import xor

from oarlock.live.decoders.messages import MessageDecoder
from oarlock.live.decoders.quantities import are_sound
from oarlock.live.reading import Reading, Value

KNOT_M_S = 1852.0 / 3600.0
_KMH_M_S = 1.0 / 3.6
_CENTURY_FROM = 80
"""Two digits of a year from here on are of the century before."""


def decoder(*, datagrams: bool = False) -> MessageDecoder:
    """A decoder of one receiver.

    Args:
        datagrams: each packet has whole sentences, of which the last may lack its end, as in UDP.
    """
    return MessageDecoder(_readings, datagrams=datagrams)


def sentence(body: str) -> bytes:
    """A sentence with its checksum and end, of what stands between "$" and "*"."""
    return f"${body}*{_checksum(body.encode('ascii')):02X}\r\n".encode("ascii")


def _checksum(body: bytes) -> int:
    return reduce(xor, body, 0)


def _readings(line: bytes) -> list[Reading] | None:
    if b"$" not in line and line.strip():
        return None
    body, star, checksum = line.strip().rpartition(b"$")[2].partition(b"*")
    if not body and not star:
        return []
    try:
        if int(checksum, 16) != _checksum(body) or len(checksum) != 2:
            return None
        kind, *cells = body.decode("ascii").split(",")
        read = {"RMC": _rmc, "VTG": _vtg}.get(kind[2:])
        found = read(cells) if read and len(kind) == 5 else None
    except (ValueError, IndexError, OverflowError):
        return None
    if found is not None and not are_sound(found.values):
        return None
    return [] if found is None else [found]


def _rmc(cells: list[str]) -> Reading:
    time, valid, latitude, north, longitude, east, speed, course, date = cells[:9]
    clock_s = _epoch_s(date, time) if date and time else None
    if valid != "A":
        return Reading("", clock_s, {"fix": "none"})
    values: dict[str, Value] = {
        "latitude_deg": _degrees(latitude, north, "NS"),
        "longitude_deg": _degrees(longitude, east, "EW"),
    }
    if speed:
        values["speed_m_s"] = float(speed) * KNOT_M_S
    if course:
        values["course_deg"] = float(course)
    return Reading("", clock_s, values)


def _vtg(cells: list[str]) -> Reading | None:
    course, _, _, _, knots, _, kmh = cells[:7]
    if cells[8:9] == ["N"] or not (knots or kmh):
        return None
    # km/h have as many decimals as knots, and are the smaller unit.
    values: dict[str, Value] = {"speed_m_s": float(kmh) * _KMH_M_S if kmh else float(knots) * KNOT_M_S}
    if course:
        values["course_deg"] = float(course)
    return Reading("vtg", None, values)


def _degrees(text: str, side: str, sides: str) -> float:
    """Degrees of ddmm.mmmm, with the sign of its side."""
    whole, minutes = divmod(float(text), 100.0)
    return (whole + minutes / 60.0) * (1.0, -1.0)[sides.index(side)]


def _epoch_s(date: str, time: str) -> float:
    """Seconds since 1970 of ddmmyy and hhmmss.ss, UTC."""
    day, month, year = (int(date[at : at + 2]) for at in (0, 2, 4))
    moment = datetime.datetime(
        year + (1900 if year >= _CENTURY_FROM else 2000),
        month,
        day,
        int(time[:2]),
        int(time[2:4]),
        tzinfo=datetime.UTC,
    )
    seconds = float(time[4:])
    if not 0.0 <= seconds < 61.0:
        raise ValueError("no time of day")
    return moment.timestamp() + seconds
