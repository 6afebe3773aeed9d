"""Clocks of devices that are tied by the movement that all sensors measure."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from senders import START_NS, packets_of, rig_of, with_test_format

import oarlock
from oarlock import rowing
from oarlock.live.intake import TIE_SLEW, Tie
from oarlock.live.lately import Lately
from oarlock.live.rig import Feed
from oarlock.live.session import LiveSession, command, recorded
from oarlock.live.ties import Ties, looked

JOINTS = ("trunk", "r_shoulder_rotation", "r_elbow_flexion", "r_elbow_rotation", "l_elbow_flexion")
LATE_S = {"back": 0.010, "r_forearm": 0.025, "l_upperarm": 0.012}
"""How much longer the readings of some units need at least."""


def rowed(sculler, seconds):
    return oarlock.simulate(
        sculler, rowing.sculling(sculler, seconds, 24, surge=False, seed=4), seed=4, rate_hz=100
    )


def packets(recording, **faults):
    """Packets of devices of which some need longer."""
    sent = [
        replace(one, arrival_ns=one.arrival_ns + int(1e9 * LATE_S.get(stream.name, 0.0)))
        for device, stream in enumerate(recording.streams)
        for one in packets_of(oarlock.Recording([stream]), seed=device, **faults)
    ]
    return sorted(sent, key=lambda packet: packet.arrival_ns)


def lived(session, sent, told):
    """Estimates of a session with commands at their times."""
    ordered = sorted([*sent, *told], key=lambda packet: packet.arrival_ns)
    return [one for packet in ordered for one in session.take(packet)]


def error_deg(estimates, truth, from_s):
    """RMS of some joints. A delay that all clocks share is none of theirs."""
    time_s = np.array([one.time_s for one in estimates])
    later = time_s > from_s
    names = estimates[0].belief.state_names
    mean = np.array([one.belief.mean for one in estimates])[later]
    wrong = []
    for shift_s in np.arange(0.0, 0.03, 1e-3):
        off = [
            mean[:, names.index(name)]
            - np.interp(time_s[later] - shift_s, truth.time_s, truth.q[:, truth.coordinate_names.index(name)])
            for name in JOINTS
        ]
        wrong.append(np.sqrt(np.mean(np.square(off))))
    return np.rad2deg(min(wrong))


@pytest.mark.long
def test_clocks_that_are_25_ms_apart_agree_after_two_looks(sculler, monkeypatch):
    """The first look is at 2 to 22 s. Mounts that were learnt with clocks apart are forgotten slowly afterwards."""
    with_test_format(monkeypatch)
    truth, recording = rowed(sculler, 65.0)
    faults = {"drift_ppm": 50.0, "jitter_ms": 10.0, "burst": 3, "loss": 0.03}
    rig, sent = rig_of(sculler, recording, wait_s=0.08), packets(recording, **faults)
    session = LiveSession(rig, sculler, START_NS)
    ties, told, found = Ties(session.intake), [command(START_NS + 2_000_000_000, "track")], []
    is_tracked = False
    for packet in sent:
        now_s = session.intake.seconds(packet.arrival_ns)
        if now_s > 2.0 and not is_tracked:
            is_tracked = True
            session.take(told[0])
        look = ties.look(now_s, None) if is_tracked else None
        if look is not None:
            for keys in ties.commands(look, looked(look, sculler), now_s):
                told.append(command(packet.arrival_ns, "clock", **keys))
                session.take(told[-1])
        found += session.take(packet)
    assert not session.problems
    devices = session.intake.feeding()
    late_s = {name: devices[name].tie.late_s for name in rig_names(rig)}
    reference = np.median([late_s[name] - LATE_S.get(name, 0.0) for name in late_s])
    units = [name for name in late_s if not name.endswith("alpha")]
    assert all(abs(late_s[n] - LATE_S.get(n, 0.0) - reference) < 3e-3 for n in units), late_s
    assert all(abs(devices[n].tie.late_s - devices[n].tie.used_s(1e9)) == 0.0 for n in units)

    untied = lived(LiveSession(rig, sculler, START_NS), sent, told[:1])
    again = lived(LiveSession(rig, sculler, START_NS), sorted_with(sent, told), [])
    np.testing.assert_array_equal([one.belief.mean for one in again], [one.belief.mean for one in found])
    tied_deg, untied_deg = (error_deg(one, truth, 50.0) for one in (found, untied))
    # With clocks that are right from the start 0.07.
    assert untied_deg > 0.35
    assert tied_deg < 0.5 * untied_deg


def sorted_with(sent, told):
    """The packets of a session in the order in which it took them: commands before packets of the same arrival."""
    return sorted([*told, *sent], key=lambda packet: packet.arrival_ns)


def rig_names(rig):
    return [feed.stream for feed in rig.feeds]


def test_a_tie_is_a_command_so_that_the_recording_repeats_it(sculler, monkeypatch):
    with_test_format(monkeypatch)
    recording = rowed(sculler, 9.0)[1]
    rig, sent = rig_of(sculler, recording, wait_s=0.08), packets(recording, jitter_ms=3.0)
    told = [
        command(START_NS + 2_000_000_000, "track"),
        command(START_NS + 4_000_000_000, "clock", stream="r_forearm", late_s=0.012, std_s=0.001),
        command(START_NS + 60_000_000_000, "stop"),
    ]
    session = LiveSession(rig, sculler, START_NS)
    found = lived(session, sent, told)
    assert not session.problems
    again = recorded(sorted_with(sent, told), rig, START_NS)
    whole = oarlock.track(sculler, again.slice(start_s=session.from_s), config=session.config)
    # Two readings of a unit within one tick have a sample between ticks, which is no row of a track.
    rows = [one for one in found if one.time_s in set(whole.time_s)]
    np.testing.assert_array_equal([one.time_s for one in rows], whole.time_s)
    np.testing.assert_array_equal(rows[-1].belief.mean, whole.last_belief.mean)
    np.testing.assert_array_equal(rows[-1].belief.std, whole.last_belief.std)
    assert len(found) - len(rows) <= 2
    plain = recorded(sent, rig, START_NS)["r_forearm"].time_s
    moved_s = plain - again["r_forearm"].time_s
    assert np.abs(moved_s[plain < 3.9]).max() == 0.0
    np.testing.assert_allclose(moved_s[plain > 7.0], 0.012, atol=1e-12)
    assert np.diff(moved_s).max() < 2e-4


def test_a_tie_is_slewed():
    tie = Tie()
    assert tie.used_s(100.0) == 0.0
    tie.late_s = -0.02
    used_s = np.array([tie.used_s(100.0 + 0.1 * step) for step in range(100)])
    assert np.abs(np.diff(used_s)).max() <= TIE_SLEW * 0.1 + 1e-12
    assert used_s[-1] == -0.02


def test_a_command_that_is_none_changes_nothing(sculler):
    rig = rig_of(sculler, rowed(sculler, 2.0)[1])
    session = LiveSession(rig, sculler, START_NS)
    session.take(command(START_NS, "clock", stream="r_forearm", late_s="x", std_s=0.0))
    session.take(command(START_NS, "clock", stream="nobody", late_s=0.01, std_s=0.0))
    assert len(session.problems) == 1
    assert session.intake.feeding() == {}


@pytest.fixture
def ties(sculler):
    """Ties of an intake whose devices are heard."""
    names = ("seat", "back", "r_forearm", "l_forearm")
    feeds = tuple(Feed(name, "scalar", "radio", name, ("value",)) for name in names)
    devices = {name: SimpleNamespace(name=name) for name in names}
    intake = SimpleNamespace(rig=SimpleNamespace(feeds=feeds), feeding=lambda: devices, on_timed=None)
    made = Ties(intake)
    made.devices = devices
    for name in names:
        for step in range(3000):
            made._lately[name].add(0.01 * step, 0.0)
    return made


def look_of(ties, now_s):
    ties._due_s = now_s
    return ties.look(now_s, None)


def test_what_is_not_known_well_enough_is_not_used(ties):
    look = look_of(ties, 30.0)
    assert sorted(look.groups) == [("back",), ("l_forearm",), ("r_forearm",), ("seat",)]
    assert all(len(rows) == 2000 for rows in look.rows)
    found = {"seat": (0.1, 3e-4), "back": (0.125, 5e-4), "r_forearm": (0.2, 5e-3), "l_forearm": (0.4, 5e-4)}
    (told,) = ties.commands(look, found, 35.0)
    # Of the seat, the surest; an uncertain one is left, and one of 0.3 s is no way that a reading takes.
    assert told["stream"] == "back"
    assert told["late_s"] == pytest.approx(0.025)
    assert 5e-4 < told["std_s"] < 5e-3
    assert ties.commands(look, {"seat": (0.1, 5e-3), "back": (0.1, 5e-3)}, 36.0) == []
    assert ties.commands(look, {}, 36.0) == []


def test_looks_are_averaged_become_rare_and_follow_a_change(ties):
    rng, late_s, told = np.random.default_rng(2), [], []
    now_s, first = 30.0, look_of(ties, 30.0)
    for _ in range(12):
        look = replace(first, late_s={name: known.late_s for name, known in ties._known.items()})
        seen = 0.01 + rng.normal(0.0, 1e-3)
        told += ties.commands(look, {"seat": (0.0, 2e-4), "back": (seen, 1e-3)}, now_s)
        late_s.append(ties._known["back"].late_s)
        now_s = ties._due_s
    # Three standard deviations of the mean of four.
    assert np.abs(np.array(late_s[3:]) - 0.01).max() < 1.5e-3
    assert now_s > 30.0 + 10 * 120.0
    assert len(told) < 6
    (changed,) = ties.commands(look, {"seat": (0.0, 2e-4), "back": (0.03, 1e-3)}, now_s)
    assert changed["late_s"] == pytest.approx(0.03)
    assert ties._due_s == now_s + 20.0


def test_nothing_is_known_of_the_clock_of_an_exchanged_device(ties):
    ties.commands(look_of(ties, 30.0), {"seat": (0.0, 2e-4), "back": (0.02, 5e-4)}, 30.0)
    ties.devices["back"] = SimpleNamespace(name="another")
    look = look_of(ties, 30.0)
    assert "back" not in look.late_s


def test_the_last_readings_become_a_stream_in_the_order_of_their_times():
    lately = Lately(Feed("back", "imu", "radio", "", ("gyro_rad_s", "mag_ut")), 10.0)
    for step in [*range(2000, 4000), 3900, 3850, 4000]:
        lately.add(0.01 * step, {"gyro_rad_s": (step, 1.0, 2.0)})
    stream = lately.since(30.0).stream()
    np.testing.assert_allclose(stream.time_s, 0.01 * np.arange(3000, 4001))
    np.testing.assert_allclose(stream.gyro_rad_s[:, 0], np.arange(3000, 4001))
    assert stream.mag_ut is None
    assert len(lately.rows) == lately.width * 1003
