"""Packets to estimates: what is tracked live is what a track of the recording gives, bit for bit."""

import numpy as np
import pytest
from senders import START_NS, packets_of, rig_of, with_test_format

import oarlock
from oarlock import rowing
from oarlock.live.disk import SessionDisk
from oarlock.live.recorder import Recorder, read_packets
from oarlock.live.session import LiveSession, command, recorded


@pytest.fixture(scope="module")
def rowed(sculler):
    """Units at 100 Hz and encoders at 50 Hz; tracking begins when the clocks have settled."""
    motion = rowing.sculling(sculler, 9.0, 24, surge=False, seed=4)
    _, recording = oarlock.simulate(sculler, motion, seed=4, rate_hz=100)
    slow = [s.at_rows(slice(None, None, 2)) if s.kind == "scalar" else s for s in recording.streams]
    return oarlock.Recording(slow)


def lived(rig, model, packets, folder):
    """A session from its packets, recorded as it runs; tracking begins at 3 s."""
    session, recorder, found = LiveSession(rig, model, START_NS), Recorder(SessionDisk(folder)), []
    track = command(START_NS + 3_000_000_000, "track")
    ordered = sorted([*packets, track], key=lambda packet: packet.arrival_ns)
    for packet in [*ordered, command(packets[-1].arrival_ns + 1, "stop")]:
        recorder.write(packet)
        found += session.take(packet)
    recorder.close()
    assert not session.problems
    return session, found


@pytest.mark.parametrize("faults", [{}, {"drift_ppm": 50.0, "jitter_ms": 10.0, "burst": 3, "loss": 0.03}])
def test_the_track_of_the_recording_is_the_live_track(sculler, rowed, tmp_path, monkeypatch, faults):
    with_test_format(monkeypatch)
    rig = rig_of(sculler, rowed, wait_s=0.05)
    session, found = lived(rig, sculler, packets_of(rowed, **faults), tmp_path)
    again = recorded(read_packets(tmp_path), rig, START_NS)
    whole = oarlock.track(sculler, again.slice(start_s=session.from_s), config=session.config)
    np.testing.assert_array_equal([one.time_s for one in found], whole.time_s)
    np.testing.assert_array_equal(found[-1].belief.mean, whole.last_belief.mean)
    np.testing.assert_array_equal(found[-1].belief.std, whole.last_belief.std)
