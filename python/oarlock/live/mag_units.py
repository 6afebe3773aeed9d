"""Magnetometers in arbitrary units: how many uT their unit is, from the rig file or from their first readings."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from oarlock.formats.arbitrary_units import mag_factor

if TYPE_CHECKING:
    from oarlock.live.reading import Value

FIRST_READINGS = 50
"""From so many the unit is learnt: the median of their norms is set to the nominal field, as for files."""


@dataclass
class MagUnit:
    """The unit of one stream's magnetometer.

    Args:
        unit_ut: uT; None until it is learnt.
        is_learnt: from readings; otherwise the rig file has it.
    """

    unit_ut: float | None = None
    is_learnt: bool = False
    _first: list[tuple[float, ...]] = field(default_factory=list)

    def field_ut(self, reading: Value | None) -> tuple[float, ...] | None:
        """A reading in uT; None while the unit is unknown."""
        if not isinstance(reading, tuple):
            return None
        if self.unit_ut is None:
            self._learn(reading)
        return None if self.unit_ut is None else tuple(self.unit_ut * value for value in reading)

    def _learn(self, reading: tuple[float, ...]) -> None:
        if math.hypot(*reading) > 0.0:
            self._first.append(reading)
        if len(self._first) >= FIRST_READINGS:
            self.unit_ut, self.is_learnt = mag_factor(self._first), True
            self._first.clear()
