"""Power meters over Bluetooth, characteristic 0x2A63; Open Rowing Monitor sends it, too.

Source: Bluetooth SIG, "Cycling Power Service 1.1", section 3.2. Revolutions and the times of the last ones
wrap: times of the wheel after 32 s, of the crank after 64 s. They are unwrapped here, as long as no gap is
longer than that.
"""

from __future__ import annotations

from oarlock.live.decoders.fields import Field, number, values_of, width_of
from oarlock.live.decoders.flagged import Flagged, announced, flags_of
from oarlock.live.reading import Reading

_MEASUREMENT = 0x2A63
_POWER = Field("power_w", 2, signed=True)
_BY_BIT: tuple[Flagged, ...] = (
    (0, (Field("balance_percent", 1, 0.5),)),
    (2, (Field("torque_sum_n_m", 2, 1.0 / 32.0),)),
    (4, (Field("wheel_turns", 4), Field("wheel_time_s", 2, 1.0 / 2048.0))),
    (5, (Field("crank_turns", 2), Field("crank_time_s", 2, 1.0 / 1024.0))),
    (6, (Field("greatest_force_n", 2, signed=True), Field("least_force_n", 2, signed=True))),
    (
        7,
        (
            Field("greatest_torque_n_m", 2, 1.0 / 32.0, signed=True),
            Field("least_torque_n_m", 2, 1.0 / 32.0, signed=True),
        ),
    ),
    (8, (Field("", 3),)),  # the angles of greatest and least force, twice 12 bits
    (9, (Field("top_dead_spot_deg", 2),)),
    (10, (Field("bottom_dead_spot_deg", 2),)),
    (11, (Field("energy_j", 2, 1000.0),)),
)
_WRAPS_AT = {
    "torque_sum_n_m": 2.0**16 / 32.0,
    "wheel_turns": 2.0**32,
    "wheel_time_s": 2.0**16 / 2048.0,
    "crank_turns": 2.0**16,
    "crank_time_s": 2.0**16 / 1024.0,
}


def decoder() -> CyclingPowerDecoder:
    """A decoder of one power meter."""
    return CyclingPowerDecoder()


class CyclingPowerDecoder:
    """Notifications of one power meter. Sums, counts and times are unwrapped from those of its first message on."""

    def __init__(self) -> None:
        self.damaged = 0
        self._last: dict[str, float] = {}

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The reading of a notification; a characteristic other than 0x2A63 gives none."""
        if channel and number(channel) != _MEASUREMENT:
            return []
        fields = [_POWER, *announced(_BY_BIT, flags_of(data))]
        if len(data) < 2 + width_of(fields):
            self.damaged += 1
            return []
        values = values_of(fields, data[2:])
        return [Reading("", None, {name: self._unwrapped(name, value) for name, value in values.items()})]

    def _unwrapped(self, name: str, value: float) -> float:
        wrap = _WRAPS_AT.get(name)
        if wrap is None:
            return value
        before = self._last.get(name, value)
        self._last[name] = before + (value - before) % wrap
        return self._last[name]
