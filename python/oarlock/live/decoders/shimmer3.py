"""Decodes a Shimmer3 with LogAndStream firmware by its Bluetooth serial port: data packets and answers to commands.

Sources: the protocol as pyshimmer documents it; tables in `shimmer3_channels`. Data packets have neither checksum
nor length: after damage a packet is one if what follows it is a packet, too, and their clocks fit the sampling
rate. The optional checksums of newer firmware must be off. The inquiry response must come before the data, or be
given.
"""

from __future__ import annotations

from oarlock.live.decoders.shimmer3_channels import (
    CALIBRATION_BYTES,
    INQUIRY_BYTES,
    ChannelCalibration,
    PacketLayout,
    calibrations_of,
    channel_count,
    layout_of,
    values_of,
)
from oarlock.live.decoders.wrapping import Wrapping
from oarlock.live.reading import Reading

GET_INQUIRY, GET_CALIBRATION, START, STOP = b"\x01", b"\x2c", b"\x07", b"\x20"
"""Commands; the unit answers each with FF, then with the response if there is one."""
_DATA, _INQUIRY, _RATE, _CALIBRATION, _IN_STREAM, _STATUS, _ACK = 0x00, 0x02, 0x04, 0x2D, 0x8A, 0x71, 0xFF
_RESPONSES = (_INQUIRY, _RATE, _CALIBRATION)
_RATE_BYTES = _STATUS_BYTES = 3
_TICKS_HZ, _TICKS = 32768.0, 2**24
_MOST_LOST = 16
"""Packets that may be missing between two that are taken to follow each other."""
_NONE, _MORE = -1, 0


def decoder(*, accel: str = "", inquiry: str = "") -> Shimmer3Decoder:
    """A decoder of one unit.

    Args:
        accel: which accelerometer is `accel_m_s2`: "LN" (low noise) or "WR" (wide range); "" for LN where there is one.
        inquiry: the inquiry response without its first byte, in hexadecimal digits, for a stream that lacks it.

    Raises:
        ValueError: accel is another, or inquiry is no response.
    """
    if accel not in ("", "LN", "WR"):
        raise ValueError(f'accel is "{accel}"; expected LN or WR')
    response = bytes.fromhex(inquiry)
    layout = layout_of(response) if len(response) > INQUIRY_BYTES else None
    if inquiry and layout is None:
        raise ValueError(f'inquiry is "{inquiry}"; expected the bytes after 02 of an inquiry response')
    return Shimmer3Decoder(accel, layout)


class Shimmer3Decoder:
    """The stream of one unit."""

    def __init__(self, accel: str, layout: PacketLayout | None) -> None:
        self.damaged = 0
        self._accel, self._layout = accel, layout
        self._calibrations: dict[str, ChannelCalibration] = {}
        self._clock = Wrapping(_TICKS)
        self._last: int | None = None
        self._in_step = layout is None
        self._rest = b""

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The readings that these bytes complete, in the order of their packets."""
        data, at = self._rest + data, 0
        found: list[Reading] = []
        while at < len(data) and (size := self._size(data, at)) != _MORE:
            if size == _NONE:
                self.damaged += self._in_step
                self._in_step = False
                at += 1
                continue
            found += self._taken(data[at : at + size])
            self._in_step = True
            at += size
        self._rest = data[at:]
        return found

    def _size(self, data: bytes, at: int) -> int:
        """Bytes of the message that begins there; `_NONE` if none does, `_MORE` if that shows only later."""
        first = data[at]
        if first == _DATA and self._layout is not None:
            return self._data_size(data, at, 4 + self._layout.size, self._layout.period)
        if first == _ACK:
            return self._ack_size(data, at)
        if self._in_step and first == _IN_STREAM:
            known = data[at + 1 : at + 2] in (b"", bytes((_STATUS,)))
            return _within(data, at, _STATUS_BYTES) if known else _NONE
        # In a stream, responses are believed only behind their acknowledgement.
        return _response_size(data, at) if self._in_step and self._last is None else _NONE

    def _ack_size(self, data: bytes, at: int) -> int:
        if at + 1 == len(data):
            return _MORE
        size = _response_size(data, at + 1) if data[at + 1] in _RESPONSES else _NONE
        if size == _NONE:
            return 1 if self._in_step else _NONE
        return size + 1 if size else _MORE

    def _data_size(self, data: bytes, at: int, size: int, period: int) -> int:
        if len(data) < at + 4:
            return _MORE
        ticks = _ticks(data, at)
        step = (ticks - self._last) % _TICKS if self._last is not None else 1
        if self._in_step and 0 < step <= _MOST_LOST * period:
            return _within(data, at, size)
        # Two packets if the first fits the last before the damage, else three.
        packets = 2 if self._last is not None and _fits(step, period, _TICKS // 16) else 3
        for following in range(at + size, at + packets * size, size):
            if len(data) > following and data[following] != _DATA:
                return _NONE
            if len(data) < following + 4:
                return _MORE
            if not _fits(
                _ticks(data, following) - _ticks(data, following - size), period, _MOST_LOST * period
            ):
                return _NONE
        return size

    def _taken(self, message: bytes) -> list[Reading]:
        if message[0] == _DATA and self._layout is not None:
            self._last = _ticks(message, 0)
            values = values_of(self._layout.counts(message[4:]), self._calibrations, self._accel)
            return [Reading("", self._clock.unwrapped(self._last) / _TICKS_HZ, values)]
        response = message.removeprefix(bytes((_ACK,)))
        if response[:1] == bytes((_INQUIRY,)):
            self._layout, self._last = layout_of(response[1:]), None
        elif response[:1] == bytes((_CALIBRATION,)):
            self._calibrations = calibrations_of(response[1:])
        return []


def _response_size(data: bytes, at: int) -> int:
    """Bytes of the response that begins there."""
    first = data[at]
    if first == _RATE:
        return _within(data, at, _RATE_BYTES)
    if first == _CALIBRATION:
        size = _within(data, at, 1 + CALIBRATION_BYTES)
        return size if size == _MORE or calibrations_of(data[at + 1 : at + size]) else _NONE
    if first != _INQUIRY:
        return _NONE
    head = data[at + 1 :]
    if len(head) < INQUIRY_BYTES:
        return _MORE
    size = INQUIRY_BYTES + channel_count(head)
    if len(head) < size:
        return _MORE
    return 1 + size if layout_of(head[:size]) is not None else _NONE


def _within(data: bytes, at: int, size: int) -> int:
    return size if at + size <= len(data) else _MORE


def _ticks(data: bytes, at: int) -> int:
    return int.from_bytes(data[at + 1 : at + 4], "little")


def _fits(step: int, period: int, most: int) -> bool:
    """Whether a step of the clock is one or some sampling periods, but for an eighth of one."""
    step %= _TICKS
    periods = (step + period // 2) // period
    return periods > 0 and step <= most and abs(step - periods * period) <= period // 8
