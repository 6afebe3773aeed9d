"""The notifications of a PM5, for its emulator: values to bytes, as the specification lists them.

Source: Concept2, "PM Bluetooth Smart Communication Interface Definition", revision 1.30. Written from it,
apart from the decoder, so that each checks the other. Numbers are unsigned and little-endian.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from struct import pack
from types import MappingProxyType

from oarlock.live.emulators.rower import Values

NEWTONS_PER_POUND = 4.4482216152605
WORDS_OF_A_PART = 9
# 15 is the largest number of parts that four bits hold.
MOST_WORDS = 15 * WORDS_OF_A_PART


def general_status(v: Values, is_multiplexed: bool) -> bytes:
    """0x0031, 19 bytes: a row without a target, work in progress."""
    states = bytes([1, 0, 1, 1, round(v["stroke_state"])])
    totals = _three(v["distance_m"]) + _three(0.0) + bytes([0x80, round(v["drag_factor"])])
    return _hundredths(v["elapsed_s"]) + _three(10.0 * v["distance_m"]) + states + totals


def additional_status(v: Values, is_multiplexed: bool) -> bytes:
    """0x0032, 17 bytes, or 19 with the average power."""
    pace = round(100.0 * v["pace_s_per_500_m"])
    rate, heart_rate = round(v["rate_per_min"]), round(v.get("heart_rate_per_min", 255.0))
    head = pack("<HBBHHH", round(1000.0 * v["speed_m_s"]), rate, heart_rate, pace, pace, 0)
    power = pack("<H", round(v["power_w"])) if is_multiplexed else b""
    return _hundredths(v["elapsed_s"]) + head + _three(0.0) + power + b"\x00"


def additional_status_2(v: Values, is_multiplexed: bool) -> bytes:
    """0x0033, 20 bytes, or 18 without the average power."""
    power = b"" if is_multiplexed else pack("<H", round(v["power_w"]))
    split = pack(
        "<HHHH", round(v["energy_kcal"]), round(100.0 * v["pace_s_per_500_m"]), round(v["power_w"]), 0
    )
    return _hundredths(v["elapsed_s"]) + b"\x00" + power + split + _three(0.0) + _three(0.0)


def stroke_data(v: Values, is_multiplexed: bool) -> bytes:
    """0x0035, 20 bytes, or 18 without the work."""
    drive = pack(
        "<BBH", *(round(100.0 * v[n]) for n in ("handle_travel_m", "drive_time_s", "recovery_time_s"))
    )
    forces = (round(10.0 * v[name] / NEWTONS_PER_POUND) for name in ("peak_force_n", "mean_force_n"))
    work = b"" if is_multiplexed else pack("<H", round(10.0 * v["work_j"]))
    head = _hundredths(v["elapsed_s"]) + _three(10.0 * v["distance_m"]) + drive
    boat = pack("<HHH", round(100.0 * v["distance_per_stroke_m"]), *forces)
    return head + boat + work + pack("<H", round(v["stroke_number"]))


def additional_stroke_data(v: Values, is_multiplexed: bool) -> bytes:
    """0x0036, 15 bytes, or 17 with the work."""
    body = pack("<HHH", round(v["power_w"]), round(v["energy_rate_kcal_per_h"]), round(v["stroke_number"]))
    work = pack("<H", round(10.0 * v["work_j"])) if is_multiplexed else b""
    return _hundredths(v["elapsed_s"]) + body + _three(0.0) + _three(0.0) + work


def additional_status_3(v: Values, is_multiplexed: bool) -> bytes:
    """0x003E, 12 bytes: in a workout."""
    return bytes([2, 0, 1, *bytes(9)])


def force_curve(force_n: Sequence[float]) -> list[bytes]:
    """0x003D, the parts of a curve: each begins with (parts << 4 | words) and its index; words are whole pounds."""
    pounds = [round(force / NEWTONS_PER_POUND) for force in force_n[:MOST_WORDS]]
    cut = [pounds[at : at + WORDS_OF_A_PART] for at in range(0, len(pounds), WORDS_OF_A_PART)]
    return [
        bytes([len(cut) << 4 | len(words), index]) + pack(f"<{len(words)}H", *words)
        for index, words in enumerate(cut)
    ]


MESSAGES: Mapping[int, Callable[[Values, bool], bytes]] = MappingProxyType(
    {
        0x31: general_status,
        0x32: additional_status,
        0x33: additional_status_2,
        0x35: stroke_data,
        0x36: additional_stroke_data,
        0x3E: additional_status_3,
    }
)
"""Characteristic -> its bytes from SI values, alone or (True) behind the first byte of the multiplexed one."""


def _hundredths(seconds: float) -> bytes:
    return _three(100.0 * seconds)


def _three(value: float) -> bytes:
    return (round(value) % (1 << 24)).to_bytes(3, "little")
