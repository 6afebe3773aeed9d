"""Decodes lines of text of sensors that somebody built: our own line protocol, or JSON, one object a line.

``t_us,seq,ax,ay,az,gx,gy,gz,mx,my,mz`` as `oarlock.formats.devices.lines` reads it from files: microseconds since
the unit was switched on, a count of samples, m/s2, rad/s, uT; without magnetometer a line ends after ``gz``. A line
with the names of the columns is skipped. JSON: see `json_lines`. A unit may mix both. Lines end with LF and have at
most 4096 bytes.
"""

from __future__ import annotations

import math

from oarlock.formats.devices.lines import HEADER, SHORT_HEADER, sample_of
from oarlock.live.decoders.json_lines import JsonObjects, MicrosecondCounter
from oarlock.live.decoders.messages import MessageDecoder
from oarlock.live.reading import Reading, Value

_COLUMNS = (("accel_m_s2", 2), ("gyro_rad_s", 5), ("mag_ut", 8))
_HEADERS = (HEADER.encode(), SHORT_HEADER.encode())


def decoder(*, datagrams: bool = False) -> MessageDecoder:
    """A decoder of one sender.

    Args:
        datagrams: each packet has whole lines, of which the last may lack its LF, as in UDP.
    """
    return MessageDecoder(_LineReader().readings, datagrams=datagrams)


class _LineReader:
    def __init__(self) -> None:
        self._clock = MicrosecondCounter()
        self._objects = JsonObjects()

    def readings(self, line: bytes) -> list[Reading] | None:
        line = line.strip()
        if line.startswith(b"{"):
            return self._objects.readings(line)
        if not line or line.replace(b" ", b"") in _HEADERS:
            return []
        numbers = sample_of(line)
        return None if numbers is None else [self._reading(numbers)]

    def _reading(self, numbers: list[float]) -> Reading:
        values: dict[str, Value] = {
            name: tuple(numbers[first : first + 3])
            for name, first in _COLUMNS
            if not any(map(math.isnan, numbers[first : first + 3]))
        }
        time_us = self._clock.time_us.unwrapped(int(numbers[0]))
        return Reading("", time_us / 1e6, values, self._clock.count.unwrapped(int(numbers[1])))
