"""A virtual rowing machine of the Fitness Machine Service on which somebody rows at a steady rate.

Source: Bluetooth SIG, "Fitness Machine Service 1.0", section 4.8 (rower data). As a PM5 does, it sends a record each
second in two notifications; the first says that more follows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import count
from struct import pack

from bumble.device import Device

from oarlock_lab.emulators.bluetooth import Offers, Peripheral, notify, placed, sender
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring, on_the_way
from oarlock_lab.emulators.rower import Rowing, Values

_SERVICE, _ROWER_DATA = "1826", "2AD1"
_MORE, _DISTANCE, _PACE, _POWER, _ENERGY, _ELAPSED = 1 << 0, 1 << 2, 1 << 3, 1 << 5, 1 << 8, 1 << 11
_UNIT = "erg"


def record(v: Values) -> tuple[bytes, bytes]:
    """Distance, pace, power and time; then rate, strokes and energy."""
    distance = round(v["distance_m"]).to_bytes(3, "little")
    rest = pack("<HhH", round(v["pace_s_per_500_m"]), round(v["power_w"]), round(v["elapsed_s"]))
    first = pack("<H", _MORE | _DISTANCE | _PACE | _POWER | _ELAPSED) + distance + rest
    hourly = v["energy_rate_kcal_per_h"]
    energy = pack("<HHB", round(v["energy_kcal"]), round(hourly), round(hourly / 60.0))
    strokes = pack("<BH", round(2.0 * v["rate_per_min"]), round(v["stroke_number"]))
    return first, pack("<H", _ENERGY) + strokes + energy


def messages(emulated: Emulated, rowing: Rowing | None = None) -> Iterator[DeviceMessage]:
    """A record each second."""
    rower = rowing or Rowing()
    for due_s, time_s, _ in on_the_way(emulated, ((float(second), None) for second in count())):
        for part in record(rower.values(time_s)):
            yield DeviceMessage(due_s, _UNIT, part, _ROWER_DATA)


def wiring(emulated: Emulated) -> Wiring:
    """It feeds no sensor."""
    return Wiring("ftms", {_UNIT: sender("erg")}, {})


async def run(
    device: Device,
    told: Iterable[DeviceMessage],
    *,
    name: str = "Oarlock erg",
    sent: Callable[[DeviceMessage], None] = lambda message: None,
) -> None:
    """Be a machine until all is sent, or it is cancelled.

    Args:
        device: of `air`, on a link of this process or on an adapter.
        told: `messages`.
        name: that it advertises.
        sent: called with each message that was notified.
    """
    peripheral = Peripheral(device, name, {_SERVICE: Offers([_ROWER_DATA])})
    async with peripheral.there():
        await notify(peripheral, told, sent=sent)


async def emulate(emulated: Emulated) -> None:
    """Send at the place's adapter until the recording's time is over, or it is cancelled."""
    async with placed(emulated) as device:
        await run(device, messages(emulated))
