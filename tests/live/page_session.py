"""A whole session with its page in a thread of its own, fed by simulated senders: for tests in a browser."""

from __future__ import annotations

import asyncio
import dataclasses
import socket
import threading
from concurrent.futures import Future
from functools import cache

from senders import encoded, rig_of

from oarlock import rowing
from oarlock.live.live import Live
from oarlock.live.page import page_server
from oarlock.live.picture import LivePicture
from oarlock.live.simulated_devices import Faults, deliveries
from oarlock.live.transports.udp import free_port
from oarlock.simulation.simulate import simulate

STROKES = {
    "columns": [
        {"key": "rate", "label": "Rate", "unit": "per min"},
        {"key": "catch", "label": "Catch", "unit": "deg"},
        {"key": "arc", "label": "Arc", "unit": "deg", "better": "high"},
        {"key": "drive", "label": "Drive time", "unit": "s"},
    ]
}


@cache
def rowed(model, seconds, rate_hz, seed):
    """A recording of sculling, and what its units send."""
    motion = rowing.sculling(model, seconds, 24, surge=False, seed=seed)
    recording = simulate(model, motion, seed=seed, rate_hz=rate_hz)[1]
    return recording, list(deliveries(recording, Faults()))


class PageSession:
    """Rows for `seconds`, in true time. `silenced` names streams that stop; `spare` adds a unit that nobody uses."""

    def __init__(self, model, folder, seconds=60.0, port=0, token="", look=None, rate_hz=100, seed=6):
        recording, self.sent = rowed(model, seconds, rate_hz, seed)
        self.port_in, self.silenced = free_port(), set()
        rig = rig_of(model, recording, {"port": self.port_in, "host": "127.0.0.1"})
        # One for all of them, as a device keeps its port: from another it would be another device.
        self.beside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.live = Live(rig, model, folder, picture=LivePicture.of(model, look))
        self.server = page_server(
            self.live, port=port, token=token, title="Simulated sculler", more={"strokes": STROKES}
        )
        self.ready = threading.Event()
        self.ended: Future[None] = Future()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self.thread.start()
        if not self.ready.wait(60):
            self.ended.result(0)
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        """Ends the session; its page loses the connection."""
        if self.thread.is_alive():
            self.loop.call_soon_threadsafe(self.running.cancel)
            self.thread.join(60)
        self.beside.close()

    @property
    def url(self):
        return self.server.url

    def call(self, work):
        """Runs `work()` in the session's own loop."""
        found: Future = Future()
        self.loop.call_soon_threadsafe(lambda: found.set_result(work()))
        return found.result(60)

    def stroke(self, number, **values):
        told = {key: {"value": value, "std": 0.01 * abs(value)} for key, value in values.items()}
        message = {"type": "stroke", "number": number, "time_s": 2.5 * number, "values": told}
        self.call(lambda: self.server.announce(message))

    def spare(self):
        """One reading of a unit that the rig does not use."""
        self.also("spare-7", **self.sent[0].values)

    def also(self, device, **values):
        """One reading of a device that feeds no sensor."""
        data = encoded(dataclasses.replace(self.sent[0], device=device, values=values))
        self.beside.sendto(data, ("127.0.0.1", self.port_in))

    def _run(self):
        try:
            asyncio.run(self._live())
        except asyncio.CancelledError:
            pass
        except BaseException as error:
            self.ended.set_exception(error)

    async def _live(self):
        self.loop = asyncio.get_running_loop()
        self.running = asyncio.current_task()
        session = asyncio.create_task(self.live.run())
        await self.live.started.wait()
        self.ready.set()
        try:
            await self._send()
            await session
        finally:
            session.cancel()
            await asyncio.gather(session, return_exceptions=True)

    async def _send(self):
        begun_s = self.loop.time()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for one in self.sent:
                wait_s = one.due_s - (self.loop.time() - begun_s)
                if wait_s > 0:
                    await asyncio.sleep(wait_s)
                if one.device not in self.silenced:
                    sender.sendto(encoded(one), ("127.0.0.1", self.port_in))
