"""Rower data of fitness machines over Bluetooth, characteristic 0x2AD1.

Source: Bluetooth SIG, "Fitness Machine Service 1.0", section 4.8 (rower data), and "GATT Specification
Supplement". Bit 0 of the flags says that more data of the same moment follow in another notification. A field
of ones only is "not available".
"""

from __future__ import annotations

from oarlock.live.decoders.fields import Field, number, values_of
from oarlock.live.decoders.flagged import Flagged, announced, fitting, flags_of
from oarlock.live.reading import Reading

_ROWER_DATA = 0x2AD1
_MORE = 1
_RESISTANCE_BIT = 7


def _unsigned(name: str, width: int, scale: float = 1.0) -> Field:
    return Field(name, width, scale, absent=256**width - 1)


def _watts(name: str) -> Field:
    return Field(name, 2, absent=-1, signed=True)


_BY_BIT: tuple[Flagged, ...] = (
    (1, (_unsigned("average_rate_per_min", 1, 0.5),)),
    (2, (_unsigned("distance_m", 3),)),
    (3, (_unsigned("pace_s_per_500_m", 2),)),
    (4, (_unsigned("average_pace_s_per_500_m", 2),)),
    (5, (_watts("power_w"),)),
    (6, (_watts("average_power_w"),)),
    (_RESISTANCE_BIT, (_unsigned("resistance_level", 2),)),
    (
        8,
        (
            _unsigned("energy_kcal", 2),
            _unsigned("energy_rate_kcal_per_h", 2),
            _unsigned("energy_rate_kcal_per_min", 1),
        ),
    ),
    (9, (_unsigned("heart_rate_per_min", 1),)),
    (10, (_unsigned("metabolic_equivalent", 1, 0.1),)),
    (11, (_unsigned("elapsed_s", 2),)),
    (12, (_unsigned("remaining_s", 2),)),
)
_RATE = (_unsigned("rate_per_min", 1, 0.5), _unsigned("stroke_number", 2))


def decoder(resistance_bytes: int | None = None) -> FtmsDecoder:
    """A decoder of one machine.

    Args:
        resistance_bytes: the width of the resistance level: 2 in the first edition of the standard, as the PM5 sends
            it, 1 in the newer supplement. None: 2 if the message is long enough for that.
    """
    return FtmsDecoder((2, 1) if resistance_bytes is None else (resistance_bytes,))


class FtmsDecoder:
    """Notifications of one machine. A record is complete with the notification whose bit 0 is clear.

    Args:
        resistance_widths: that a message may have, in the order of preference.
    """

    def __init__(self, resistance_widths: tuple[int, ...] = (2, 1)) -> None:
        self.damaged = 0
        self._widths = resistance_widths
        self._pending: dict[str, float] = {}
        self._seen: set[str] = set()

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The record that this notification completes; bytes behind its fields are left out, as monitors pad them.

        Args:
            data: the notification.
            channel: the UUID of its characteristic; others than 0x2AD1 give nothing.
        """
        if channel and number(channel) != _ROWER_DATA:
            return []
        flags = flags_of(data)
        fields = fitting(self._variants(flags), data[2:]) if len(data) > 2 else None
        if fields is None:
            self.damaged += 1
            return []
        self._join(fields, data)
        if flags & _MORE:
            return []
        values, self._pending, self._seen = self._pending, {}, set()
        return [Reading("", None, values)] if values else []

    def _join(self, fields: list[Field], data: bytes) -> None:
        """Add a part to the record. A field that comes again belongs to the next record: the last part was lost."""
        names = {field.name for field in fields}
        if names & self._seen:
            self.damaged += 1
            self._pending, self._seen = {}, set()
        self._pending |= values_of(fields, data[2:])
        self._seen |= names

    def _variants(self, flags: int) -> list[list[Field]]:
        rate = list(_RATE) if not flags & _MORE else []
        return [
            rate
            + [
                field._replace(width=width, absent=256**width - 1)
                if field.name == "resistance_level"
                else field
                for field in announced(_BY_BIT, flags)
            ]
            for width in self._widths
        ]
