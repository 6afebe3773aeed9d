"""Emulates Open Rowing Monitor: metrics by the WebSocket of its page, or once a stroke to an MQTT broker.

Sources: its pages docs/Integrations.md and docs/Architecture.md, and what release 0.9.6 sends: its page gets metrics
each 200 ms. To the broker most numbers go as texts, and durations in ms.
"""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterator
from itertools import count

from oarlock_lab.emulators.carriers import carry
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, UnitAddress, Wiring, on_the_way
from oarlock_lab.emulators.rower import DRIVING, Rowing

PAGE_RATE_HZ = 5.0
STARTED = datetime.datetime(2026, 6, 1, 8, 0, 0, tzinfo=datetime.UTC)
TOPIC = "OpenRowingMonitor/erg/metrics"


def page_metrics(rowing: Rowing, time_s: float) -> bytes:
    """What the page gets: durations in s, the curves of the last drive once there is one."""
    v = rowing.values(time_s)
    told: dict[str, object] = {
        "timestamp": _moment(time_s).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        "sessionState": "Rowing",
        "strokeState": _state(v["stroke_state"]),
        "totalMovingTime": v["elapsed_s"],
        "totalNumberOfStrokes": int(v["stroke_number"]),
        "totalLinearDistance": v["distance_m"],
        "totalCalories": v["energy_kcal"],
        "cycleStrokeRate": v["rate_per_min"],
        "cyclePace": v["pace_s_per_500_m"],
        "cyclePower": v["power_w"],
        "cycleLinearVelocity": v["speed_m_s"],
        "cycleDuration": rowing.stroke_s,
        "cycleDistance": v["distance_per_stroke_m"],
        "driveDuration": v["drive_time_s"],
        "driveLength": v["handle_travel_m"],
        "drivePeakHandleForce": v["peak_force_n"],
        "driveAverageHandleForce": v["mean_force_n"],
        "recoveryDuration": v["recovery_time_s"],
        "dragFactor": v["drag_factor"],
    }
    if time_s >= rowing.drive_s:
        told["driveHandleForceCurve"] = rowing.force_n()
    return json.dumps({"type": "metrics", "data": told}).encode()


def broker_metrics(rowing: Rowing, time_s: float) -> bytes:
    """What the broker gets at the end of a stroke: texts, durations in ms."""
    v = rowing.values(time_s)
    told: dict[str, object] = {
        "timestamp": f"{_moment(time_s).timestamp():.3f}",
        "intervaltype": "JustRow",
        "sessionState": "Rowing",
        "strokeState": _state(v["stroke_state"]),
        "isMoving": True,
        "totalNumberOfStrokes": f"{v['stroke_number']:.0f}",
        "totalMovingTime": f"{v['elapsed_s']:.5f}",
        "totalDistance": f"{v['distance_m']:.5f}",
        "totalCalories": f"{v['energy_kcal']:.5f}",
        "strokeDuration": f"{1e3 * rowing.stroke_s:.5f}",
        "driveDuration": f"{1e3 * v['drive_time_s']:.5f}",
        "recoveryDuration": f"{1e3 * v['recovery_time_s']:.5f}",
        "driveLength": f"{v['handle_travel_m']:.5f}",
        "distancePerStroke": f"{v['distance_per_stroke_m']:.5f}",
        "strokeRate": f"{v['rate_per_min']:.5f}",
        "velocity": f"{v['speed_m_s']:.5f}",
        "pace": f"{v['pace_s_per_500_m']:.5f}",
        "power": f"{v['power_w']:.5f}",
        "peakHandleForce": f"{v['peak_force_n']:.5f}",
        "averageHandleForce": f"{v['mean_force_n']:.5f}",
        "dragfactor": f"{v['drag_factor']:.5f}",
        "heartrate": "NaN",
        "forceCurve": [round(force, 3) for force in rowing.force_n()],
    }
    return json.dumps(told).encode()


def messages(emulated: Emulated, rowing: Rowing | None = None) -> Iterator[DeviceMessage]:
    """All that the page, or the broker, gets."""
    rower = rowing or Rowing()
    if emulated.place.transport == "mqtt":
        # A moment before the next stroke begins.
        moments = ((number * rower.stroke_s - 1e-3, broker_metrics) for number in count(1))
    else:
        moments = ((number / PAGE_RATE_HZ, page_metrics) for number in count())
    for due_s, time_s, made in on_the_way(emulated, moments):
        yield DeviceMessage(due_s, _unit(emulated), made(rower, time_s))


def wiring(emulated: Emulated) -> Wiring:
    """It feeds no sensor."""
    place, unit = emulated.place, _unit(emulated)
    options: dict[str, object] = {"url": f"ws://{place.host}:{place.port}/websocket"}
    address = f"{place.host}:{place.port}"
    if place.transport == "mqtt":
        options = {"host": place.host, "port": place.port, "topic": "OpenRowingMonitor/+/metrics"}
        address = TOPIC
    return Wiring("open_rowing_monitor", {unit: UnitAddress("erg", place.transport, options, address)}, {})


async def emulate(emulated: Emulated) -> None:
    """Send until the recording's time is over, or it is cancelled."""
    await carry(emulated, [_unit(emulated)], messages(emulated))


def _unit(emulated: Emulated) -> str:
    return TOPIC if emulated.place.transport == "mqtt" else "page"


def _moment(time_s: float) -> datetime.datetime:
    return STARTED + datetime.timedelta(milliseconds=round(1e3 * time_s))


def _state(number: float) -> str:
    return "Drive" if number == DRIVING else "Recovery"
