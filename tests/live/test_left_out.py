"""What a session leaves out, forgets and tells: absurd readings, old senders, damage, datagrams that were lost."""

import json

import pytest
from senders import START_NS

from oarlock.live import health as health_module
from oarlock.live.disk import SessionDisk
from oarlock.live.event_log import EventLog, read_events
from oarlock.live.health import Watch
from oarlock.live.intake import MOST_SENDERS, is_plausible
from oarlock.live.reading import Packet
from oarlock.live.session import LiveSession, recorded
from oarlock.live.simulated_devices import LINES, lines_rig
from oarlock.live.transports.transport import Options
from oarlock.live.transports.udp import Udp
from oarlock.storage.errors import DataError


@pytest.fixture
def session(sculler):
    return LiveSession(lines_rig(sculler, "sculler", 1, 100.0, ("back", "seat")), sculler, START_NS)


def packet(time_s, told, address="10.0.0.1:7000"):
    data = told if isinstance(told, bytes) else json.dumps(told).encode()
    return Packet(LINES, address, "", START_NS + int(1e9 * time_s), data)


def unit(time_s, rate=0.1, **keys):
    told = {"device": "back", "t_us": round(1e6 * time_s), "gyro_rad_s": [rate, 0, 0]}
    return packet(time_s, told | {"accel_m_s2": [0, 0, 9.8], "mag_ut": [20, 0, 40]}, **keys)


def test_what_no_sensor_can_measure_is_left_out_told_and_not_recorded(session):
    watch = Watch(session.intake)
    packets = [unit(0.01 * k, 1e6 if k in (250, 251) else 0.1) for k in range(400)]
    for one in packets:
        session.take(one)
    assert "2 readings of back are beyond what a sensor can measure: check its unit and scale" in set(
        watch.events(4.0)
    )
    assert list(watch.events(4.5)) == []
    back = recorded(packets, session.rig, START_NS).sensor("back")
    assert abs(back.gyro_rad_s).max() == 0.1
    (device,) = session.intake.devices.values()
    assert device.implausible == 2 and device.readings == 400


@pytest.mark.parametrize(
    ("values", "is_possible"),
    [
        (999.0, True),
        (-1e9, False),
        ({"gyro_rad_s": (0.0, -34.9, 0.0)}, True),
        ({"gyro_rad_s": (0.0, 0.0, -50.0)}, False),
        ({"gyro_rad_s": (0.0, 0.0, 1.0), "accel_m_s2": (3000.0, 0.0, 0.0)}, False),
        ({"quat_wxyz": (1.0, 0.0, 0.0, 0.0)}, True),
    ],
)
def test_the_ranges_of_sensors(values, is_possible):
    assert is_plausible(values) == is_possible


def test_damage_is_told_at_once_and_then_every_ten_seconds(session):
    watch = Watch(session.intake)
    for k in range(5):
        session.take(packet(1.0, b"{rubbish" + b"x" * k))
    assert list(watch.events(1.5)) == ["5 messages of lines could not be decoded"]
    session.take(packet(2.0, b"\xff\xfe"))
    assert list(watch.events(2.0)) == [] and list(watch.events(11.0)) == []
    assert list(watch.events(11.6)) == ["1 messages of lines could not be decoded"]


def test_a_sender_that_is_silent_for_longest_is_forgotten_and_its_damage_still_counts(session):
    session.take(unit(0.0, address="10.0.0.1:1"))
    for k in range(MOST_SENDERS + 50):
        session.take(packet(1.0 + 0.01 * k, b"rubbish", f"10.0.1.1:{k}"))
        session.take(unit(1.005 + 0.01 * k, address="10.0.0.2:1"))
    assert len(session.intake._decoders) == MOST_SENDERS
    assert session.intake.damaged(LINES) == MOST_SENDERS + 50
    assert [device.address for device in session.intake.devices.values()] == ["10.0.0.2:1"]


def test_a_unit_that_sends_from_another_address_is_told_when_the_first_has_fallen_silent(session):
    watch = Watch(session.intake)
    session.take(unit(0.0, address="10.0.0.1:1"))
    assert list(watch.events(0.1)) == []
    session.take(unit(0.5, address="10.0.0.2:1"))
    assert list(watch.events(0.6)) == []
    session.take(unit(0.9, address="10.0.0.2:1"))
    assert list(watch.events(1.0)) == ["back comes from 10.0.0.2:1/back now, before from 10.0.0.1:1/back"]
    assert list(watch.events(1.2)) == []


def test_datagrams_that_the_kernel_dropped_are_told(session, monkeypatch):
    count = [0]
    monkeypatch.setattr(health_module, "dropped", lambda transport: count[0])
    watch = Watch(session.intake, {"units": Udp("units", Options("units", {"port": 0}))})
    assert list(watch.events(1.0)) == []
    count[0] = 7
    (text,) = watch.events(1.5)
    assert text.startswith("7 datagrams of units were lost because this machine is busy")
    assert list(watch.events(2.0)) == []


def test_commands_that_fail_are_counted_and_only_the_last_kept(session):
    from oarlock.live.session import MOST_PROBLEMS, command

    for k in range(3 * MOST_PROBLEMS):
        session.take(command(START_NS + k, "assign", stream=f"nobody {k}"))
    assert session.refused == 3 * MOST_PROBLEMS and len(session.problems) == MOST_PROBLEMS
    assert f"nobody {3 * MOST_PROBLEMS - 1}" in session.problems[-1]


def test_a_second_sender_of_one_name_is_refused_and_named_while_the_first_speaks(session):
    watch, second = Watch(session.intake), "10.0.0.2:7000"
    told = []
    for k in range(500):
        if k < 300:
            session.take(unit(0.01 * k))
        if k >= 100:
            session.take(unit(0.01 * k, 0.5, address=second))
        if k % 50 == 49:
            told += watch.events(0.01 * k)
    first, other = (session.intake.devices[LINES, address, "back"] for address in ("10.0.0.1:7000", second))
    assert first.refused == 0 and first.readings == 300
    # a second after the first has fallen silent the other one has its streams
    assert other.refused == pytest.approx(300, abs=2) and other.readings == pytest.approx(100, abs=2)
    (sentence,) = {
        one for one in told if one.startswith(f"{second}/back sends as back, too") and "50 read" in one
    }
    assert "were not used" in sentence


def test_a_sender_with_another_address_for_each_packet_is_one(session):
    for k in range(2 * MOST_SENDERS):
        session.take(unit(0.01 * k, address=f"10.0.0.1:{7000 + k}"))
        assert {id(one) for one in session.intake._feeders.values()} <= {
            *map(id, session.intake.devices.values())
        }
    assert sum(device.refused for device in session.intake.devices.values()) == 0


@pytest.mark.parametrize(
    "order",
    [
        {"do": "assign", "stream": "back", "device": 5},
        {"do": "assign", "stream": "nobody", "device": "back"},
        {"do": "note", "text": "half \ud800", "time_s": 1.0},
        {"do": "note", "text": "a", "arrival_ns": 3},
        {"do": "step", "name": "a", "begin_s": float("nan"), "end_s": 1.0},
        {"do": "sing"},
        [],
    ],
)
def test_a_command_that_is_none_changes_nothing_live_and_later(session, order):
    lines = [unit(0.01 * k) for k in range(50)]
    one = Packet("", "", "", START_NS + 1, json.dumps(order).encode())
    session.take(one)
    assert session.refused == 1
    assert recorded([*lines, one, *lines[-1:]], session.rig, START_NS).sensor("back").time_s.size == 50


def test_the_log_keeps_whole_lines(tmp_path):
    log = EventLog(SessionDisk(tmp_path))
    log.write(1.234, "back is silent")
    log.close()
    with (tmp_path / "events.jsonl").open("a") as file:
        file.write('{"time_s": 2.0, "te')
    assert read_events(tmp_path) == [{"time_s": 1.23, "text": "back is silent"}]


def test_a_recording_needs_a_reading(session):
    with pytest.raises(DataError, match="no reading"):
        recorded([packet(1.0, b"rubbish")], session.rig, START_NS)
