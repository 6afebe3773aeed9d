"""Concept2 PM5 over Bluetooth: status, strokes and force curves from its notifications.

Source: Concept2, "PM Bluetooth Smart Communication Interface Definition", revision 1.30; fields in
`pm5_fields`. Values are valid only as notifications: a characteristic that is read gives junk.

A reading's `device` says what it describes: `status` (0x0031, 0x0032, 0x0033, 0x003E), `drive` (the end of a
drive: the first 0x0035, 0x0036, and the force curve 0x003D), `stroke` (the second 0x0035, at the end of the
recovery). The recovery time of a `drive` is that of the stroke before. The monitor's time `elapsed_s` counts
from an interval's start and stops in pauses, so it is a value and not the reading's clock. `drag_factor` is
in 1e-6 N m s2.
"""

from __future__ import annotations

from oarlock.live.decoders.fields import Field, number, values_of, width_of
from oarlock.live.decoders.pm5_fields import ALONE, MULTIPLEXED, POUND_FORCE_N
from oarlock.live.reading import Reading, Value

_MULTIPLEXED = 0x80
_STROKE = 0x35
_STROKE_POWER = 0x36
_FORCE_CURVE = 0x3D
_DURATIONS = {
    0x00: ("workout_duration_s", 0.01),
    0x40: ("workout_energy_kcal", 1.0),
    0x80: ("workout_distance_m", 1.0),
}
_DRIVE = ("handle_travel_m", "drive_time_s", "peak_force_n", "mean_force_n")


def decoder() -> Pm5Decoder:
    """A decoder of one monitor."""
    return Pm5Decoder()


class Pm5Decoder:
    """Notifications of one monitor; `channel` is the UUID of their characteristic.

    Characteristics that are not decoded, such as the summaries of splits, give no reading and count as no
    damage.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._drive: dict[str, float] = {}
        self._curve = _Curve()

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The reading of a notification; none for a part of a force curve before its last.

        Args:
            data: the notification.
            channel: the UUID of its characteristic, in full or its first eight or four digits.
        """
        which, fields = number(channel), ALONE
        if which == _MULTIPLEXED:
            which, data, fields = (data[0] if data else -1), data[1:], MULTIPLEXED
        if which == _FORCE_CURVE:
            return self._force_curve(data)
        if which is None or which == -1:
            self.damaged += 1
        elif which in fields:
            return self._numbers(which, fields[which], data)
        return []

    def _numbers(self, which: int, fields: tuple[Field, ...], data: bytes) -> list[Reading]:
        if len(data) < width_of(fields):
            self.damaged += 1
            return []
        values = values_of(fields, data)
        device = "drive" if which == _STROKE_POWER else self._phase(values) if which == _STROKE else "status"
        return [Reading(device, None, _with_duration(values))]

    def _phase(self, values: dict[str, float]) -> str:
        """Which of the two messages of a stroke this is: the second repeats the drive of the first."""
        before, self._drive = self._drive, values
        if before and (_same(before, values, _DRIVE) or _same(before, values, ("stroke_number",))):
            self._drive = {}
            return "stroke"
        if values["drive_time_s"] == 0.0:  # what the monitor sends when a rest ends
            self._drive = {}
        return "drive"

    def _force_curve(self, data: bytes) -> list[Reading]:
        pounds, lost = self._curve.after(data)
        self.damaged += lost
        return (
            [Reading("drive", None, {"handle_force_n": tuple(POUND_FORCE_N * p for p in pounds)})]
            if pounds
            else []
        )


class _Curve:
    """The parts of a force curve: each begins with (parts << 4 | words) and its index."""

    def __init__(self) -> None:
        self._words: list[int] = []
        self._next = 0

    def after(self, data: bytes) -> tuple[list[int], int]:
        """The curve's words if this part is its last, and how many curves were lost: 1 at a gap or a damaged part."""
        parts, words, index = (data[0] >> 4, data[0] & 0x0F, data[1]) if len(data) >= 2 else (0, 0, 0)
        unfinished = int(self._next > 0)
        if index >= parts or len(data) != 2 + 2 * words or index not in (0, self._next):
            self._begin()
            return [], 1
        if index == 0:
            self._begin()
        lost = unfinished if index == 0 else 0
        self._words += [int.from_bytes(data[at : at + 2], "little") for at in range(2, len(data), 2)]
        self._next = index + 1
        if self._next < parts:
            return [], lost
        curve = self._words
        self._begin()
        return curve, lost

    def _begin(self) -> None:
        self._words, self._next = [], 0


def _same(one: dict[str, float], other: dict[str, float], names: tuple[str, ...]) -> bool:
    return all(one[name] == other[name] for name in names)


def _with_duration(values: dict[str, float]) -> dict[str, Value]:
    """The workout's duration under the name of its unit; a duration in other units is left out."""
    named: dict[str, Value] = dict(values)
    if "workout_duration" in values:
        duration = values["workout_duration"]
        named.pop("workout_duration")
        unit = _DURATIONS.get(int(values["workout_duration_type"]))
        if unit:
            named[unit[0]] = duration * unit[1]
    return named
