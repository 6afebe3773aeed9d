"""Virtual units that are started together move together, however long their first readings take to be made."""

import asyncio
from dataclasses import dataclass

from oarlock.live.transports.ble import Ble
from oarlock.live.transports.transport import Options
from oarlock_lab.emulators import dot
from oarlock_lab.emulators.bluetooth import Air, VirtualRadio
from oarlock_lab.emulators.dot import Together
from oarlock_lab.emulators.emulated import Emulated
from oarlock_lab.emulators.kinds import KINDS
from oarlock_lab.emulators.swinging import swinging


@dataclass(frozen=True)
class Noted(Emulated):
    """Notes when its readings are made."""

    notes: list[str] = None

    def deliveries(self, **keys):
        self.notes.append("made")
        return super().deliveries(**keys)


async def started_together(emulated, notes, starts):
    """Three units, until each has sent a reading."""
    air, units = Air(), KINDS["dot"].device.wiring(emulated).senders
    together, sending = Together(len(units)), asyncio.Barrier(len(units) + 1)

    async def begun():
        notes.append("asked")
        starts.append(await together.begun())
        return starts[-1]

    async def be(unit, address):
        first = asyncio.Event()
        device = asyncio.create_task(
            dot.be(air.device(address), emulated, unit, begun=begun, sent=lambda row: first.set())
        )
        await first.wait()
        await sending.wait()
        device.cancel()

    options = {"profile": "dot", "mode": dot.MODE, **next(iter(units.values())).options}
    ble = Ble("dot", Options("dot", options), VirtualRadio(air.device()))
    tasks = [asyncio.create_task(be(unit, own.address)) for unit, own in units.items()]
    listening = asyncio.create_task(ble.run(lambda packet: None))
    await sending.wait()
    listening.cancel()
    await asyncio.gather(*tasks, listening, return_exceptions=True)


def test_a_unit_makes_its_first_reading_before_it_waits_for_the_others(pendulum):
    notes, starts = [], []
    measured = swinging(pendulum, 60.0, seed=2)[1].slice(end_s=0.5)
    emulated = Noted(measured, notes=notes)
    asyncio.run(asyncio.wait_for(started_together(emulated, notes, starts), 120.0))
    assert notes == ["made", "asked"] * 3
    assert len(starts) == 3 and len(set(starts)) == 1
