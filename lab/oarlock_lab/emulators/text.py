"""Emulates units that send our own line protocol: `t_us,seq,ax,ay,az,gx,gy,gz,mx,my,mz`, in m/s2, rad/s and uT."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring

_WRAP = 2**32


def line(delivery: Delivery) -> bytes:
    """A reading as a line; without a magnetometer it ends after the gyroscope."""
    values = cast("dict[str, tuple[float, ...]]", delivery.values)
    names = ("accel_m_s2", "gyro_rad_s", *(("mag_ut",) if "mag_ut" in values else ()))
    cells = [f"{x:.7g}" for name in names for x in values[name]]
    stamps = (round(1e6 * delivery.clock_s) % _WRAP, delivery.count % _WRAP)
    return ",".join([*map(str, stamps), *cells]).encode() + b"\n"


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """A line for each reading."""
    for delivery in emulated.deliveries():
        if {"accel_m_s2", "gyro_rad_s"} > delivery.values.keys():
            continue
        yield DeviceMessage(delivery.due_s, delivery.device, line(delivery))


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a unit of its own."""
    names = emulated.recording.names
    return Wiring("lines", senders(emulated.place, "text", names), {name: (name, "") for name in names})


async def emulate(emulated: Emulated) -> None:
    """Send until the movement ends, or it is cancelled."""
    await carry(emulated, emulated.recording.names, messages(emulated))
