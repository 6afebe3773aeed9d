"""Whether a stream's readings are of use: a unit may repeat one reading, or send none of its quantities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

STUCK_S, STUCK_READINGS = 0.5, 10
"""An inertial unit whose readings are the same for so long, to the last bit, is stuck: even at rest it has noise."""

Values = float | Mapping[str, tuple[float, ...]]


@dataclass
class Fresh:
    """The readings of one stream, as they arrive.

    Args:
        can_stick: whether repeated readings are no measurements. An encoder at rest repeats itself.
    """

    can_stick: bool
    usable_s: float = -math.inf
    """Arrival of the last reading with a value."""
    _last: Values | None = None
    _since_s: float = 0.0
    _repeats: int = 0

    @property
    def is_stuck(self) -> bool:
        """Whether the last readings repeat one reading."""
        return self._repeats >= STUCK_READINGS and self.usable_s - self._since_s >= STUCK_S

    def see(self, values: Values, arrival_s: float) -> None:
        """Takes a reading."""
        self.usable_s = arrival_s
        if not self.can_stick:
            return
        if values == self._last:
            self._repeats += 1
        else:
            self._last, self._since_s, self._repeats = values, arrival_s, 0
