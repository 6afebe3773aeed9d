"""A session with a guided start and its page in a thread of its own, and a sculler who does what the page asks."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import Future

import oarlock
from oarlock.live.guide.lead import Lead
from oarlock.live.guide.steps import Guide, GuideDurations
from oarlock.live.live import Live
from oarlock.live.page import page_server
from oarlock.live.picture import LivePicture
from oarlock.live.simulated_devices import lines_rig
from oarlock.live.transports.transport import now_ns
from oarlock.live.transports.udp import free_port
from oarlock.rowing import live_look
from oarlock.rowing.simulation.emulated import STREAMS
from oarlock.rowing.simulation.guided import GuidedSculler, send_guided

RATE_HZ = 50.0
"""Session, sculler and both browsers share the machine."""
PACE = GuideDurations(countdown_s=1.0, seconds={"turn": 40.0, "pose": 4.0, "move": 11.5})
"""A sculler who needs no time to read."""


class GuidedSession:
    """Runs until it is left; the beliefs are kept."""

    work = dict
    """It follows the session, as one that looks for strokes does, and has no work."""

    def __init__(self, model, folder, seed=3):
        self.sculler = GuidedSculler(model, seed=seed, rate_hz=RATE_HZ)
        port = free_port()
        rig = lines_rig(model, "sculler", port, RATE_HZ, STREAMS)
        drawn = live_look(model)
        picture = LivePicture.of(model, drawn.look, drawn.strands)
        self.guide = Guide(oarlock.calibration.default_plan(model), PACE)
        self.beliefs = []
        self.live = Live(rig, model, folder, picture=picture, lead=Lead(self.guide), follower=self)
        self.server, self.port = page_server(self.live, title="Guided sculler"), port
        self.ready, self.ended = threading.Event(), Future()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def step(self, time_s, belief):
        self.beliefs.append(belief)

    @property
    def url(self):
        return self.server.url

    def __enter__(self):
        self.thread.start()
        if not self.ready.wait(60):
            self.ended.result(0)
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        if self.thread.is_alive():
            self.loop.call_soon_threadsafe(self.running.cancel)
            self.thread.join(60)

    def _run(self):
        try:
            asyncio.run(self._lived())
        except asyncio.CancelledError:
            pass
        except BaseException as error:
            self.ended.set_exception(error)

    async def _lived(self):
        self.loop, self.running = asyncio.get_running_loop(), asyncio.current_task()
        session = asyncio.create_task(self.live.run())
        begun = asyncio.create_task(self.live.started.wait())
        await asyncio.wait({session, begun}, return_when=asyncio.FIRST_COMPLETED)
        if session.done():
            session.result()
        self.ready.set()
        sending = asyncio.create_task(send_guided(self.sculler, self.port, self._asked))
        try:
            await session
        finally:
            sending.cancel()
            session.cancel()
            await asyncio.gather(session, sending, return_exceptions=True)

    def _asked(self):
        return self.guide.told(), self.live.session.intake.seconds(now_ns())
