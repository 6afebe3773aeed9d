"""A source whose connection is lost and comes back, as when somebody trips over the cable: named, and read again."""

import asyncio

import pytest

from oarlock.live.health import lost
from oarlock.live.live import Live
from oarlock.live.simulated_devices import Faults, endless, json_line, lines_rig
from oarlock.live.transports import transport as transport_module
from oarlock.rowing.simulation.emulated import PERIOD_S, STREAMS, endless_sculling

RATE_HZ = 25.0
"""Low, so that a busy machine keeps up."""


@pytest.fixture(scope="module")
def sent(sculler):
    return endless_sculling(sculler, 6, RATE_HZ)


class Device:
    """Serves lines at a port; a connection that is cut is served again from where the movement is by then."""

    def __init__(self, sent):
        self.sent, self.cables, self.begun_s = sent, [], None

    async def open(self, port=0):
        self.server = await asyncio.start_server(self._serve, "127.0.0.1", port)
        return self.server.sockets[0].getsockname()[1]

    async def cut(self):
        self.server.close()
        for cable in self.cables:
            cable.transport.abort()
        self.cables = []

    async def _serve(self, _, writer):
        self.cables.append(writer)
        loop = asyncio.get_running_loop()
        self.begun_s = loop.time() if self.begun_s is None else self.begun_s
        try:
            for one in endless(self.sent, PERIOD_S, Faults()):
                early_s = one.due_s - (loop.time() - self.begun_s)
                if early_s < -1.0:
                    continue
                await asyncio.sleep(max(0.0, early_s))
                writer.write(json_line(one))
                await writer.drain()
        except ConnectionError:
            return


async def until(is_so):
    while not is_so():
        await asyncio.sleep(0.02)


def test_a_cable_that_is_pulled_and_put_back_is_named_and_tracking_goes_on(
    sculler, sent, tmp_path, monkeypatch
):
    monkeypatch.setattr(transport_module, "LONGEST_PAUSE_S", 0.5)
    said = []

    async def work():
        device = Device(sent)
        port = await device.open()
        rig = lines_rig(sculler, "sculler", port, RATE_HZ, STREAMS)
        rig.sources["lines"] = rig.sources["lines"].__class__(
            "lines", "lines", "tcp", {"host": "127.0.0.1", "port": port}
        )
        live = Live(rig, sculler, tmp_path / "today", on_event=said.append)
        running = asyncio.create_task(live.run())
        await until(lambda: "tracking" in said)
        await device.cut()
        await until(lambda: any(text.startswith("source lines: lost 127.0.0.1") for text in said))
        await until(lambda: "back is silent" in said)
        before = live.estimates
        await device.open(port)
        await until(lambda: "source lines: works again" in said and "back is back" in said)
        await until(lambda: live.estimates > before + 20)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await device.cut()

    asyncio.run(asyncio.wait_for(work(), 300))
    assert [text for text in said if text.startswith("source lines: lost")][1:] == []


@pytest.mark.parametrize(
    ("state", "problem"),
    [
        ("listens at port 9000", ""),
        ("connects to 127.0.0.1:9", None),
        ("lost 127.0.0.1:9 (Connection refused); connects again in 2 s", "all"),
        ("receives from A; lost B (gone); connects again in 1 s", "all"),
        ("receives from A; connects to B", None),
        ("receives from A; waits for its turn to connect to B", None),
    ],
)
def test_what_a_state_says_of_a_loss(state, problem):
    assert lost(state) == (state if problem == "all" else problem)
