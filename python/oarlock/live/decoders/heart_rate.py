"""Heart rate belts and watches over Bluetooth, characteristic 0x2A37.

Source: Bluetooth SIG, "Heart Rate Service 1.0", section 3.1.
"""

from __future__ import annotations

from oarlock.live.decoders.fields import number
from oarlock.live.reading import Reading, Value

_MEASUREMENT = 0x2A37
_WIDE = 0x01
_TOUCHES = 0x02
_FEELS = 0x04
_ENERGY = 0x08
_INTERVALS = 0x10
_TICKS_PER_S = 1024.0


def decoder() -> HeartRateDecoder:
    """A decoder of one belt."""
    return HeartRateDecoder()


class HeartRateDecoder:
    """Notifications of one belt: `heart_rate_per_min`, and if sent `skin_contact` (1 or 0), `energy_j`, `rr_s`.

    `rr_s` are the intervals between beats since the message before, the oldest first.
    """

    def __init__(self) -> None:
        self.damaged = 0

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The reading of a notification; a characteristic other than 0x2A37 gives none."""
        if channel and number(channel) != _MEASUREMENT:
            return []
        flags = data[0] if data else 0
        widths = [1 + bool(flags & _WIDE), 2 * bool(flags & _ENERGY)]
        if len(data) < 1 + sum(widths):
            self.damaged += 1
            return []
        rate, at = int.from_bytes(data[1 : 1 + widths[0]], "little"), 1 + widths[0]
        values: dict[str, Value] = {"heart_rate_per_min": float(rate)}
        if flags & _FEELS:
            values["skin_contact"] = float(bool(flags & _TOUCHES))
        if flags & _ENERGY:
            values["energy_j"] = 1000.0 * int.from_bytes(data[at : at + 2], "little")
        if flags & _INTERVALS:
            values["rr_s"] = _intervals(data[at + widths[1] :])
        return [Reading("", None, values)]


def _intervals(data: bytes) -> tuple[float, ...]:
    return tuple(
        int.from_bytes(data[at : at + 2], "little") / _TICKS_PER_S for at in range(0, len(data) - 1, 2)
    )
