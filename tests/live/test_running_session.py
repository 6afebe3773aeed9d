"""A whole session over real sockets: sources, recorder, tracker and page together."""

import asyncio
import contextlib
import json
import socket
from itertools import groupby

import numpy as np
import pytest
from senders import encoded, rig_of, with_test_format
from websockets.asyncio.client import connect

import oarlock
from oarlock import rowing
from oarlock.live.folder import LiveFolder
from oarlock.live.live import FRAMES_HZ, Live
from oarlock.live.picture import LivePicture
from oarlock.live.server import PageServer
from oarlock.live.simulated_devices import Faults, deliveries
from oarlock.live.transports.transport import Options
from oarlock.live.transports.udp import Udp, free_port
from oarlock_lab.soak.virtual import VirtualTime

SECONDS = 6.0
SHOWN_EACH_S = 0.1


class TimedUdp(Udp):
    """Receives datagrams at a real port, at times of the test's clock: a busy machine makes no reading late."""

    def __init__(self, source, time):
        super().__init__(source.name, Options(source.name, source.options))
        self.time, self.received = time, 0

    def packet(self, sender, arrival_ns, data):
        self.received += 1
        return super().packet(sender, self.time.now_ns(), data)


async def viewed(server, frames, told):
    """A viewer that shows every frame it gets."""
    async with connect(f"ws://127.0.0.1:{server.port}/live") as page:
        async for message in page:
            told.append(json.loads(message))
            if told[-1]["type"] == "now":
                frames += [told[-1]["frame"]] if "frame" in told[-1] else []
                await page.send('{"shown": 1}')


async def until(is_so):
    while not is_so():
        await asyncio.sleep(0.0)


async def send(sent, live, time, port, frames):
    """Sends each packet when it is due and the one before was received; each block of them shows a frame."""
    begun_ns, radio, count = time.now_ns(), live.transports["radio"], 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _, block in groupby(sent, lambda delivery: int(delivery.due_s / SHOWN_EACH_S)):
            await asyncio.sleep(1.1 / FRAMES_HZ)  # no more frames a second are published
            shown, estimates = len(frames), live.estimates
            for delivery in block:
                await time.until(begun_ns + int(1e9 * delivery.due_s))
                sender.sendto(encoded(delivery), ("127.0.0.1", port))
                count += 1
                await until(lambda: radio.received == count)  # noqa: B023 (awaited within the turn)
            if live.estimates > estimates:
                await until(lambda: len(frames) > shown)  # noqa: B023


async def lived(live, sent, port):
    frames, told = [], []
    running = asyncio.create_task(live.run())
    await live.started.wait()
    viewing = asyncio.create_task(viewed(live.server, frames, told))
    await until(lambda: live.server.viewers)
    await send(sent, live, live.time, port, frames)
    running.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await running
    await asyncio.gather(viewing, return_exceptions=True)
    return frames, told


@pytest.fixture(scope="module")
def rowed(sculler):
    motion = rowing.sculling(sculler, SECONDS, 24, surge=False, seed=6)
    return oarlock.simulate(sculler, motion, seed=6, rate_hz=100)


def test_packets_become_frames_a_recording_and_the_same_track(sculler, rowed, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    recording = rowed[1]
    port = free_port()
    rig = rig_of(sculler, recording, {"port": port, "host": "127.0.0.1"})
    live = Live(
        *(rig, sculler, tmp_path / "today"),
        picture=LivePicture.of(sculler),
        time=(time := VirtualTime()),
        transport_of=lambda source: TimedUdp(source, time),
    )
    live.server = PageServer({"/": b"page"}, live.do, lambda: {"type": "hello"})
    frames, told = asyncio.run(lived(live, deliveries(recording, Faults()), port))

    assert len(frames) > 20 and live.transports["radio"].dropped in (0, None)
    (tracking,) = (one for one in told if one["type"] == "event" and one["text"] == "tracking")
    assert 0.0 < tracking["time_s"] < SECONDS
    place = LiveFolder.load(tmp_path / "today")
    again = oarlock.load_recording(tmp_path / "today" / "recording")
    session = place.session(sculler)
    estimates = [one for packet in place.read() for one in session.take(packet)]
    assert len(estimates) == live.estimates
    by_time = {round(one.time_s, 4): one for one in estimates}
    for frame in frames:
        one = by_time[frame["time_s"]].belief
        # the blades' feathering is no state: nothing measures it
        assert set(sculler.coordinate_names) - set(frame["joints"]) == {"r_oar_theta", "l_oar_theta"}
        for name, (value, std) in frame["joints"].items():
            column = one.state_names.index(name)
            assert (value, std) == (round(one.mean[column], 5), round(one.std[column], 5))
    whole = oarlock.track(sculler, again.slice(start_s=session.from_s), config=session.config)
    np.testing.assert_array_equal(whole.last_belief.mean, estimates[-1].belief.mean)
