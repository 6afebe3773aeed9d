"""Devices that feed no sensor of the model, such as a heart rate belt: which fell silent, and which are back."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from oarlock.live.intake import Intake

Sender = tuple[str, str]

LEAST_S = 2.0
"""Radio may hold back the readings of a device for a second."""
GAPS = 3
"""So many gaps are heard before a device is expected to go on; silence is as many times the longest of them."""
LONGEST_S = 10.0
"""A device that sends now and then is silent after this at the latest."""


@dataclass
class _Heard:
    last_s: float
    gaps: int = 0
    longest_s: float = 0.0
    is_silent: bool = False

    @property
    def patience_s(self) -> float:
        """How long it may send nothing."""
        return math.inf if self.gaps < GAPS else min(max(LEAST_S, GAPS * self.longest_s), LONGEST_S)


@dataclass
class SilentDevices:
    """Notices devices that no longer send. Of those that feed a sensor, the streams are watched instead.

    Args:
        intake: of the session.
    """

    intake: Intake
    _heard: dict[Sender, _Heard] = field(default_factory=dict)
    _feeding: set[Sender] = field(default_factory=set)
    """Senders that feed a sensor, or did until another unit took their place."""

    def events(self, now_s: float) -> Iterator[str]:
        """Sentences about what has changed since the last look."""
        last = self._last_s()
        for gone in [sender for sender in self._heard if sender not in last]:
            del self._heard[gone]
        for sender, last_s in last.items():
            heard = self._heard.setdefault(sender, _Heard(last_s))
            if last_s > heard.last_s:
                if heard.is_silent:
                    heard.is_silent = False
                    yield f"{self._name(sender)} is back"
                else:
                    heard.gaps += 1
                    heard.longest_s = max(heard.longest_s, last_s - heard.last_s)
                heard.last_s = last_s
            elif not heard.is_silent and now_s - last_s > heard.patience_s:
                heard.is_silent = True
                yield f"{self._name(sender)} is silent"

    def _last_s(self) -> dict[Sender, float]:
        """When each sender was heard last, without those that feed a sensor."""
        devices = self.intake.devices.values()
        self._feeding |= {device.sender for device in devices if device.streams}
        found: dict[Sender, float] = {}
        for device in devices:
            if device.sender not in self._feeding and math.isfinite(device.last_arrival_s):
                found[device.sender] = max(found.get(device.sender, -math.inf), device.last_arrival_s)
        return found

    def _name(self, sender: Sender) -> str:
        source, address = sender
        others = sum(1 for other, _ in self._heard if other == source)
        return f"{source} {address}" if address and others > 1 else source
