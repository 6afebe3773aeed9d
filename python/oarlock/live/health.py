"""How the sensors of a live session do: for the page, and as events when something changes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from oarlock.live.intake import DeviceState, Intake
from oarlock.live.reading import Value
from oarlock.live.recorder import Recorder
from oarlock.live.session import LiveSession
from oarlock.live.silent_devices import SilentDevices
from oarlock.live.transports.transport import Transport
from oarlock.live.transports.udp import Udp

Key = tuple[str, str, str]

SILENT_S = 0.7
"""A stream of which nothing came for so long is silent; with four looks a second it is named within 0.95 s."""

FIELD_S = 1.0
"""A magnetic field that is disturbed, or right again, for so long is named."""

LONGEST_TEXT = 40


TOLD_AGAIN_S = 10.0
"""Damage goes on for long where it occurs: it is told this often at most."""


@dataclass
class Watch:
    """Notices what changes from one look to the next."""

    intake: Intake
    transports: Mapping[str, Transport] = field(default_factory=dict)
    _heard: set[str] = field(default_factory=set)
    _silent: set[str] = field(default_factory=set)
    _stuck: set[str] = field(default_factory=set)
    _learnt: set[str] = field(default_factory=set)
    _restarts: dict[Key, int] = field(default_factory=dict)
    _feeding: dict[str, DeviceState] = field(default_factory=dict)
    _told: dict[str, tuple[float, int]] = field(default_factory=dict)
    _dropped: dict[str, int] = field(default_factory=dict)
    _disturbed: set[str] = field(default_factory=set)
    _field_changed_s: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._others = SilentDevices(self.intake)

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
        yield from self._moved(now_s)
        restarts = {}
        for key, device in self.intake.devices.items():
            restarts[key] = device.clock.restarts
            if device.clock.restarts > self._restarts.get(key, 0):
                yield f"the clock of {device.name} was set or started again; its readings are timed anew"
        self._restarts = restarts
        yield from self._others.events(now_s)
        yield from self._left_out(now_s)
        yield from self._overrun()

    def _moved(self, now_s: float) -> Iterator[str]:
        """Streams that another device feeds, since the last one fell silent."""
        for device in self.intake.devices.values():
            for stream in device.streams:
                last = self._feeding.setdefault(stream, device)
                if (
                    last is not device
                    and now_s - last.last_arrival_s > SILENT_S > now_s - device.last_arrival_s
                ):
                    self._feeding[stream] = device
                    yield f"{stream} comes from {device.name} now, before from {last.name}"

    def _left_out(self, now_s: float) -> Iterator[str]:
        for source in self.intake.rig.sources:
            if count := self._news(source, self.intake.damaged(source), now_s):
                yield f"{count} messages of {source} could not be decoded"
        for stream, device in self._feeding.items():
            if count := self._news(f"{stream} {device.name}", device.implausible, now_s):
                yield f"{count} readings of {stream} are beyond what a sensor can measure: check its unit and scale"
        for device in self.intake.devices.values():
            if count := self._news(f"second {device.name}", device.refused, now_s):
                streams = ", ".join(device.streams)
                yield (
                    f"{device.name} sends as {streams}, too: its {count} readings were not used. "
                    f"If it is the right one, give {streams} to it, or switch the other one off"
                )

    def _news(self, what: str, count: int, now_s: float) -> int:
        """By how much a count has grown since it was told; 0 if it is not to be told yet."""
        told_s, told = self._told.get(what, (-math.inf, 0))
        if count <= told or now_s - told_s <= TOLD_AGAIN_S:
            return 0
        self._told[what] = (now_s, count)
        return count - told

    def _overrun(self) -> Iterator[str]:
        for name, transport in self.transports.items():
            count, told = dropped(transport) or 0, self._dropped.get(name, 0)
            if count > told:
                self._dropped[name] = count
                yield f"{count - told} datagrams of {name} were lost because this machine is busy: close other programs"

    def fields(self, sensors: Mapping[str, Mapping[str, Any]], now_s: float) -> Iterator[str]:
        """Sentences about magnets that come near a unit and go.

        Args:
            sensors: `Info.sensors` of the newest estimate.
            now_s: time of the look, s.
        """
        for stream, judged in sensors.items():
            field_now = judged.get("field", "missing")
            if field_now == "missing":
                continue
            is_disturbed = field_now != "undisturbed"
            if is_disturbed is (stream in self._disturbed):
                self._field_changed_s.pop(stream, None)
            elif now_s - self._field_changed_s.setdefault(stream, now_s) > FIELD_S:
                del self._field_changed_s[stream]
                if is_disturbed:
                    self._disturbed.add(stream)
                    yield (
                        f"a magnet or iron is near {stream}: its magnetometer is not used, and its heading comes from "
                        "its gyroscope and from the other units"
                    )
                else:
                    self._disturbed.remove(stream)
                    yield f"the magnetic field at {stream} is right again and used"

    def is_ready(self, now_s: float) -> bool:
        """Whether every stream is heard and every clock in use has settled."""
        feeding = [device for device in self.intake.devices.values() if device.streams]
        return not self.intake.silent(now_s, SILENT_S) and all(device.is_settled for device in feeding)


@dataclass
class Problems:
    """Says once that something does not work, and once that it works again."""

    _wrong: set[str] = field(default_factory=set)

    def events(self, now: Mapping[str, str]) -> Iterator[str]:
        """Sentences about what has changed since the last look.

        Args:
            now: what -> what is wrong with it, or an empty text; what is not named is as it was.
        """
        for name, problem in now.items():
            if problem and name not in self._wrong:
                self._wrong.add(name)
                yield f"{name}: {problem}"
            elif not problem and name in self._wrong:
                self._wrong.remove(name)
                yield f"{name}: works again"


def lost(state: str) -> str | None:
    """The state of a transport if it, or one of its links, is lost; empty if it reads, None while it tries again."""
    parts = state.split("; ")
    if any(part.startswith("lost ") for part in parts):
        return state
    return None if any(part.startswith(("connects ", "waits ")) for part in parts) else ""


def dropped(transport: Transport) -> int | None:
    """Packets that this machine received and lost before the session got them; None if it does not say."""
    return transport.dropped if isinstance(transport, Udp) else None


def health(
    session: LiveSession,
    transports: Mapping[str, Transport],
    recorder: Recorder,
    free_bytes: int | None,
    now_s: float,
) -> dict[str, Any]:
    """What the page shows of sources, devices and the recorder."""
    intake = session.intake
    arrivals = {} if session.tracker is None else session.tracker.arrivals
    return {
        "type": "health",
        "time_s": round(now_s, 2),
        "is_tracking": session.tracker is not None,
        "sources": [
            {"name": name, "state": one.state, "damaged": intake.damaged(name), "dropped": dropped(one)}
            for name, one in transports.items()
        ],
        "devices": [_device(device, now_s) for device in intake.devices.values()],
        "silent": intake.silent(now_s, SILENT_S),
        "stuck": intake.stuck(),
        "arrivals": arrivals,
        "recorder": {
            "packets": recorder.packets,
            "lost": recorder.lost,
            "elsewhere": recorder.elsewhere,
            "second": str(recorder.disk.second) if recorder.elsewhere else "",
            "failures": recorder.disk.failures,
            "problem": recorder.disk.problem,
            "free_gb": None if free_bytes is None else round(free_bytes / 1e9, 1),
        },
    }


def _device(device: DeviceState, now_s: float) -> dict[str, Any]:
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
        "implausible": device.implausible,
        "tie_ms": None if math.isnan(device.tie.std_s) else round(1e3 * device.tie.late_s, 1),
        "tie_std_ms": None if math.isnan(device.tie.std_s) else round(1e3 * device.tie.std_s, 1),
        "battery_percent": device.battery_percent,
        "silent_s": round(now_s - device.last_arrival_s, 1) if math.isfinite(device.last_arrival_s) else None,
        "channel": device.channel,
        "values": dict(_shown(device.newest)),
    }


def _shown(newest: Mapping[str, Value]) -> Iterator[tuple[str, float | str]]:
    """Numbers and short texts; the battery has its own place."""
    for name, value in newest.items():
        if isinstance(value, str):
            yield name, value[:LONGEST_TEXT]
        elif not isinstance(value, tuple) and name != "battery_percent" and math.isfinite(value):
            yield name, float(f"{value:.9g}")
