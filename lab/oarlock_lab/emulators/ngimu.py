"""Emulates NGIMU units: OSC bundles by UDP, or in SLIP frames by serial line.

Source: x-io Technologies, NgimuApi (NGIMU-Software-Public on GitHub). `/sensors` are rates in deg/s, acceleration in g,
magnetic field in uT and pressure in hPa; a unit without a synchronisation master counts its time tags from its start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import cast

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring
from oarlock_lab.emulators.osc import osc_bundle, osc_message, slip

_GRAVITY_M_S2, _PRESSURE_HPA = 9.80665, 1013.25
_BATTERY_EVERY = 250
"""Samples."""
_BATTERY = (88.0, 240.0, 4.1, -80.0)
"""Charge %, minutes left, V, mA."""


def packet(delivery: Delivery) -> bytes:
    """A sample as a bundle."""
    values = cast("dict[str, tuple[float, ...]]", delivery.values)
    nothing = (0.0, 0.0, 0.0)
    rates = [math.degrees(rate) for rate in values.get("gyro_rad_s", nothing)]
    forces = [force / _GRAVITY_M_S2 for force in values.get("accel_m_s2", nothing)]
    sensors = osc_message("/sensors", [*rates, *forces, *values.get("mag_ut", nothing), _PRESSURE_HPA])
    battery = [] if delivery.count % _BATTERY_EVERY else [osc_message("/battery", _BATTERY)]
    return osc_bundle(delivery.clock_s, [sensors, *battery])


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """A packet for each sample."""
    framed = slip if emulated.place.transport == "serial" else bytes
    for delivery in emulated.deliveries():
        yield DeviceMessage(delivery.due_s, delivery.device, framed(packet(delivery)))


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a unit of its own."""
    names = emulated.recording.names
    return Wiring("ngimu", senders(emulated.place, "ngimu", names), {name: (name, "") for name in names})


async def emulate(emulated: Emulated) -> None:
    """Send until the movement ends, or it is cancelled."""
    await carry(emulated, emulated.recording.names, messages(emulated))
