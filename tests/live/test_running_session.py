"""A whole session over real sockets: sources, recorder, tracker and page together."""

import asyncio
import json

import numpy as np
import pytest
from senders import encoded, rig_of, with_test_format
from websockets.asyncio.client import connect

import oarlock
from oarlock import rowing
from oarlock.live.emulators.deliveries import Faults, deliveries
from oarlock.live.emulators.lines import send
from oarlock.live.folder import LiveFolder
from oarlock.live.live import Live
from oarlock.live.picture import LivePicture
from oarlock.live.server import PageServer
from oarlock.live.transports.udp import free_port

SECONDS = 6.0


async def viewed(server, frames, told):
    """A viewer that shows every frame it gets."""
    async with connect(f"ws://127.0.0.1:{server.port}/live") as page:
        async for message in page:
            told.append(json.loads(message))
            if told[-1]["type"] == "now":
                frames += [told[-1]["frame"]] if "frame" in told[-1] else []
                await page.send('{"shown": 1}')


async def lived(live, sent, port):
    frames, told = [], []
    running = asyncio.create_task(live.run(SECONDS + 1.0))
    await live.started.wait()
    viewing = asyncio.create_task(viewed(live.server, frames, told))
    await send(sent, "127.0.0.1", port, encoded)
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
    live = Live(rig, sculler, tmp_path / "today", picture=LivePicture.of(sculler))
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
