"""How the sensors of a live session do: for the page, and as events when something changes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from oarlock.live.intake import Device, Intake
from oarlock.live.recorder import Recorder
from oarlock.live.session import LiveSession

SILENT_S = 0.7
"""A stream of which nothing came for so long is silent; with four looks a second it is named within 0.95 s."""


@dataclass
class Watch:
    """Notices what changes from one look to the next."""

    intake: Intake
    _heard: set[str] = field(default_factory=set)
    _silent: set[str] = field(default_factory=set)
    _stuck: set[str] = field(default_factory=set)
    _learnt: set[str] = field(default_factory=set)
    _restarts: dict[str, int] = field(default_factory=dict)

    def events(self, now_s: float) -> Iterator[str]:
        """Sentences about what has changed since the last look."""
        feeding = self.intake.feeding()
        # Before its first reading a stream is awaited, not silent.
        silent = set(self.intake.silent(now_s, SILENT_S)) & self._heard
        for stream in sorted(silent - self._silent):
            device = feeding.get(stream)
            is_heard = device is not None and now_s - device.last_arrival_s < SILENT_S
            yield f"{stream} sends no readings that can be used" if is_heard else f"{stream} is silent"
        for stream in sorted(self._silent - silent):
            yield f"{stream} is back"
        stuck = set(self.intake.stuck()) - silent
        for stream in sorted(stuck - self._stuck):
            yield f"{stream} is stuck: it repeats one reading. Switch the unit off and on"
        for stream in sorted(self._stuck - stuck - silent):
            yield f"{stream} measures again"
        self._stuck = stuck
        for stream, unit in self.intake.mag_units.items():
            if unit.is_learnt and unit.unit_ut is not None and stream not in self._learnt:
                self._learnt.add(stream)
                yield (
                    f"the magnetometer of {stream} has arbitrary units: one is taken for {unit.unit_ut:.4g} uT; "
                    f"write mag_unit_ut = {unit.unit_ut:.4g} into the rig file to keep it"
                )
        self._silent = silent
        self._heard |= set(self.intake.heard())
        for device in list(self.intake.devices.values()):
            if device.clock.restarts > self._restarts.get(device.name, 0):
                yield f"the clock of {device.name} was set or started again; its readings are timed anew"
            self._restarts[device.name] = device.clock.restarts

    def is_ready(self, now_s: float) -> bool:
        """Whether every stream is heard and every clock in use has settled."""
        feeding = [device for device in self.intake.devices.values() if device.streams]
        return not self.intake.silent(now_s, SILENT_S) and all(device.is_settled for device in feeding)


def health(
    session: LiveSession, states: Mapping[str, str], recorder: Recorder, free_bytes: int, now_s: float
) -> dict[str, Any]:
    """What the page shows of sources, devices and the recorder."""
    intake = session.intake
    arrivals = {} if session.tracker is None else session.tracker.arrivals
    return {
        "type": "health",
        "time_s": round(now_s, 2),
        "is_tracking": session.tracker is not None,
        "sources": [
            {"name": name, "state": state, "damaged": intake.damaged(name)} for name, state in states.items()
        ],
        "devices": [_device(device, now_s) for device in intake.devices.values()],
        "silent": intake.silent(now_s, SILENT_S),
        "stuck": intake.stuck(),
        "arrivals": arrivals,
        "recorder": {
            "packets": recorder.packets,
            "lost": recorder.lost,
            "problem": recorder.problem,
            "free_gb": round(free_bytes / 1e9, 1),
        },
    }


def _device(device: Device, now_s: float) -> dict[str, Any]:
    heard = device.readings + device.lost
    return {
        "name": device.name,
        "source": device.source,
        "streams": list(device.streams),
        "rate_hz": round(device.rate_hz(now_s), 1),
        "lost_percent": round(100.0 * device.lost / heard, 2) if heard else 0.0,
        "delay_ms": round(1e3 * device.delay_s, 1),
        "drift_ppm": round(1e6 * device.clock.drift, 1),
        "restarts": device.clock.restarts,
        "tie_ms": None if math.isnan(device.tie.std_s) else round(1e3 * device.tie.late_s, 1),
        "tie_std_ms": None if math.isnan(device.tie.std_s) else round(1e3 * device.tie.std_s, 1),
        "battery_percent": device.battery_percent,
        "silent_s": round(now_s - device.last_arrival_s, 1) if math.isfinite(device.last_arrival_s) else None,
    }
