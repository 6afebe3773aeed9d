"""`oarlock live track`: the estimates of a session again, as a track for all other verbs."""

import json
from dataclasses import replace

import numpy as np
import pytest
from senders import START_NS

import oarlock
from command_line import run
from oarlock import rowing
from oarlock.live.folder import LiveFolder
from oarlock.live.live_track import live_track
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.session import command
from oarlock.live.simulated_devices import LINES, Faults, deliveries, json_line, lines_rig

SECONDS = 5.0


def at_ns(time_s):
    return START_NS + round(1e9 * time_s)


@pytest.fixture(scope="module")
def sent(sculler):
    """Packets of drifting, lossy devices in the order of their arrival."""
    motion = rowing.sculling(sculler, SECONDS, 24, surge=False, seed=6)
    recording = oarlock.simulate(sculler, motion, seed=6, rate_hz=100)[1]
    faults = Faults(drift_ppm=40.0, jitter_ms=1.0, loss=0.02)
    found = [
        Packet(LINES, "10.0.0.7:5000", "", at_ns(d.due_s), json_line(d))
        for d in deliveries(recording, faults)
    ]
    return recording.names, found


def session(sculler, names, packets, folder, tracked=((2.5, "track"), (6.0, "stop"))):
    """The folder of a session that received these packets."""
    commands = [command(at_ns(time_s), do) for time_s, do in tracked]
    place = LiveFolder.create(folder, lines_rig(sculler, "sculler", 9000, 100.0, names), None, START_NS)
    recorder = Recorder(place.disk)
    for packet in sorted((*packets, *commands), key=lambda packet: packet.arrival_ns):
        recorder.write(packet)
    recorder.close()
    place.finish(sculler)
    return LiveFolder.load(folder)


def test_a_session_becomes_a_track_that_other_verbs_read(sculler, sent, tmp_path):
    place = session(sculler, *sent, tmp_path / "today")
    out = tmp_path / "track"
    said = run("live", "track", place.path, "--out", out).stdout
    assert f"oarlock track {place.path / 'recording'} --model sculler" in said.replace("\n", " ")

    again = place.session(sculler)
    made = [estimate for packet in place.read() for estimate in again.take(packet)]
    track = oarlock.load_track(out)
    assert track.time_s.tolist() == [one.time_s for one in made] and len(made) > 150
    for row in (0, len(made) // 2, -1):
        belief = made[row].belief
        mean, std = (dict(zip(belief.state_names, v, strict=True)) for v in (belief.mean, belief.std))
        for name in set(track.joint_names) & set(mean):
            assert (track[name].value[row], track[name].std[row]) == (mean[name], std[name])
            if f"{name}.velocity" in mean:
                assert track[name].velocity[row] == mean[f"{name}.velocity"]
        sensors = made[row].info.sensors
        assert [sensors[name]["used"] for name in track.info.sensor_names] == track.info.used[row].tolist()
    assert track["trunk"].observed.all() and not track["r_oar_theta"].observed.any()
    assert {count.name for count in track.counts} == set(sent[0])

    run("report", out)
    run("export", out, "--out", tmp_path / "export")
    summary = json.loads(run("live", "track", place.path, "--out", out, "--force", "--json").stdout)
    assert summary["samples"] == len(made) and summary["provenance"]["live"] is True


def test_it_is_the_track_of_the_recording_where_nothing_came_late(sculler, sent, tmp_path):
    place = session(sculler, *sent, tmp_path / "today")
    track, settings = live_track(place, sculler), place.session(sculler).config
    recording = oarlock.load_recording(place.path / "recording").slice(start_s=2.5)
    whole = oarlock.track(sculler, recording, config=settings)
    rows = np.searchsorted(whole.time_s, track.time_s)
    for name in ("q", "qd", "qdd", "q_std", "qd_std", "qdd_std"):
        np.testing.assert_array_equal(getattr(whole, name)[rows], getattr(track, name))
    np.testing.assert_array_equal(whole.observed[rows], track.observed)
    assert not any("live estimates differ" in note for note in track.notes)


def test_estimates_that_readings_came_after_are_named(sculler, sent, tmp_path):
    names, packets = sent
    held = [
        replace(p, arrival_ns=p.arrival_ns + 200_000_000)
        if b'"back"' in p.data and 3.0e9 < p.arrival_ns - START_NS < 3.2e9
        else p
        for p in packets
    ]
    track = live_track(session(sculler, names, held, tmp_path / "today"), sculler)
    (note,) = (note for note in track.notes if "live estimates differ" in note)
    assert "oarlock track" in note


def test_a_session_that_was_never_tracked_says_what_to_do(sculler, sent, tmp_path):
    place = session(sculler, *sent, tmp_path / "today", tracked=())
    error = run("live", "track", place.path, "--out", tmp_path / "track", status=1).stderr
    assert "was not tracked" in error and "oarlock track" in error
    assert not (tmp_path / "track").exists()


def test_tracking_twice_gives_times_that_grow(sculler, sent, tmp_path):
    tracked = ((2.2, "track"), (3.0, "stop"), (3.4, "track"), (4.5, "stop"))
    track = live_track(session(sculler, *sent, tmp_path / "today", tracked), sculler)
    assert (np.diff(track.time_s) > 0.0).all()
    assert np.diff(track.time_s).max() > 0.3
