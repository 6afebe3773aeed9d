"""What feeds no sensor of the model is written beside the recording, and read back as it was sent."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from senders import START_NS, encoded, packets_of, rig_of, with_test_format

import oarlock
from oarlock import rowing
from oarlock.live.channel_tables import MOST_NUMBERS, MOST_QUANTITIES, MOST_TABLES, Channels, channels
from oarlock.live.folder import LiveFolder
from oarlock.live.health import health
from oarlock.live.intake import Spare
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.rig import Rig, Source
from oarlock.live.session import LiveSession, command, recorded
from oarlock.live.simulated_devices import Delivery
from oarlock.storage.errors import DataError


def spare(channel="pm5/drive", time_s=1.0, **values):
    return Spare(channel, "AA:01", time_s, 1.25, None, values)


def saved(folder, *spares):
    made = Channels()
    for one in spares:
        made.take(one)
    made.save(folder / "channels")
    return channels(folder)


def test_numbers_curves_and_texts_are_read_back(tmp_path):
    found = saved(
        tmp_path,
        spare(force_n=(1.0, 2.0, 3.0), power_w=200.0),
        spare(time_s=None, power_w=210.0, state="drive"),
        spare(time_s=2.0, force_n=(4.0,), state="recovery"),
        Spare("gps", "127.0.0.1:5000", 3.0, 3.25, 1.7e9, {"speed_m_s": 4.5}),
    )
    assert list(found) == ["gps", "pm5/drive"]
    drive = found["pm5/drive"]
    np.testing.assert_array_equal(drive.time_s, [1.0, np.nan, 2.0])
    np.testing.assert_array_equal(drive.clock_s, [np.nan] * 3)
    np.testing.assert_array_equal(drive.values["power_w"], [200.0, 210.0, np.nan])
    np.testing.assert_array_equal(
        drive.values["force_n"], [[1.0, 2.0, 3.0], [np.nan] * 3, [4.0, np.nan, np.nan]]
    )
    assert drive.values["state"].tolist() == ["", "drive", "recovery"]
    assert drive.address.tolist() == ["AA:01"] * 3
    gps = found["gps"]
    assert (gps.time_s[0], gps.arrival_s[0], gps.clock_s[0], gps.address[0]) == (
        3.0,
        3.25,
        1.7e9,
        "127.0.0.1:5000",
    )


def test_one_quantity_has_the_rows_of_its_messages(tmp_path):
    drive = saved(
        tmp_path,
        spare(force_n=(1.0, 2.0), power_w=200.0, state="drive"),
        spare(time_s=None, power_w=210.0),
        spare(time_s=2.0, force_n=(4.0,), state="recovery"),
    )["pm5/drive"]
    assert [x.tolist() for x in drive.of("power_w")] == [[1.0], [200.0]]
    time_s, curves = drive.of("force_n")
    assert time_s.tolist() == [1.0, 2.0]
    np.testing.assert_array_equal(curves, [[1.0, 2.0], [4.0, np.nan]])
    assert [x.tolist() for x in drive.of("state")] == [[1.0, 2.0], ["drive", "recovery"]]
    with pytest.raises(DataError, match="pm5/drive has no pace_s; it has force_n, power_w, state"):
        drive.of("pace_s")


def test_rubbish_makes_neither_endless_tables_nor_wide_ones(tmp_path):
    found = saved(
        tmp_path,
        spare("a\ud800/b", **{"x\udc00": "text\ud800"}, time_s=1.0),
        spare("wide", **{f"q{n}": 1.0 for n in range(MOST_QUANTITIES + 5)}),
        spare("long", curve=(0.0,) * (MOST_NUMBERS + 1), short=(0.0,) * MOST_NUMBERS, empty=()),
        spare("mixed", value=1.0),
        spare("mixed", value="text"),
        spare("mixed", value=(1.0, 2.0)),
        *(spare(f"{n:04d}", value=1.0) for n in range(MOST_TABLES)),
    )
    assert len(found) == MOST_TABLES
    assert found["a?/b"].values["x?"].tolist() == ["text?"]
    assert len(found["wide"].values) == MOST_QUANTITIES
    assert list(found["long"].values) == ["short"]
    np.testing.assert_array_equal(found["mixed"].values["value"], [1.0, np.nan, np.nan])


def test_a_value_with_the_name_of_a_column_keeps_its_own(tmp_path):
    made = saved(tmp_path, Spare("radio", "A", 1.0, 1.25, 9.0, {"time_s": 5.0, "address": "B"}))["radio"]
    assert (made.time_s[0], made.values["time_s_of_device"][0]) == (1.0, 5.0)
    assert (made.address[0], made.values["address_of_device"][0]) == ("A", "B")


def test_tables_of_the_run_before_are_replaced(tmp_path):
    saved(tmp_path, spare("one", x=1.0), spare("two", x=1.0))
    assert list(saved(tmp_path, spare("two", x=2.0))) == ["two"]


def test_damage_is_named(tmp_path):
    with pytest.raises(DataError, match="has no folder channels"):
        channels(tmp_path)
    saved(tmp_path, spare("one", x=1.0))
    (file,) = (tmp_path / "channels").glob("*.parquet")
    file.write_bytes(file.read_bytes()[:-9])
    with pytest.raises(DataError, match=r"one\.parquet"):
        channels(tmp_path)
    (tmp_path / "channels" / "MANIFEST.toml").unlink(missing_ok=True)
    for other in (tmp_path / "channels").iterdir():
        if other.is_file():
            other.unlink()
    pq.write_table(pq.read_table(_plain_table(tmp_path)), tmp_path / "channels" / "x.parquet")
    with pytest.raises(DataError, match="was not written by a live session"):
        channels(tmp_path)


def _plain_table(folder):
    import pyarrow as pa

    file = folder / "plain.parquet"
    pq.write_table(pa.table({"time_s": [1.0]}), file)
    return file


# A whole session


@pytest.fixture(scope="module")
def rowed(sculler):
    motion = rowing.sculling(sculler, 4.0, 24, surge=False, seed=4)
    return oarlock.simulate(sculler, motion, seed=4, rate_hz=50)[1]


def extra(arrival_s, device, clock_s, **values):
    """A packet of a device that feeds no sensor."""
    data = encoded(Delivery(arrival_s, device, clock_s, 0, values))
    return Packet("erg", "E1", "", START_NS + int(1e9 * arrival_s), data)


def with_extras(rig, packets):
    """The session's packets with speed at 5 Hz, a stroke each second, and a battery of a unit."""
    whole = Rig(
        rig.model, None, {**rig.sources, "erg": Source("erg", "test-json", "udp")}, rig.feeds, rig.wait_s
    )
    speeds = [extra(0.2 * n, "", 50.0 + 0.2 * n, speed_m_s=4.0 + 0.01 * n) for n in range(20)]
    strokes = [extra(n + 0.5, "stroke", 0.0, force_n=(10.0 * n, 20.0), state=f"s{n}") for n in range(4)]
    first = json.loads(packets[0].data)
    battery = json.dumps({**first, "values": {**first["values"], "battery_percent": 77.0}}).encode()
    changed = [Packet("radio", "", "", packets[0].arrival_ns, battery), *packets[1:]]
    return whole, sorted([*changed, *speeds, *strokes], key=lambda p: p.arrival_ns)


def test_a_session_writes_them_and_its_recording_is_the_same(sculler, rowed, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    plain = rig_of(sculler, rowed)
    packets = packets_of(rowed)
    rig, mixed = with_extras(plain, packets)
    place = LiveFolder.create(tmp_path / "today", rig, None, START_NS)
    recorder, session = Recorder(place.disk), LiveSession(rig, sculler, START_NS)
    ordered = sorted([*mixed, command(START_NS + 2_500_000_000, "track")], key=lambda p: p.arrival_ns)
    for packet in ordered:
        recorder.write(packet)
        session.take(packet)
    recorder.close()
    ending = place.finish(sculler)
    made = ending.recording
    assert (ending.damage, ending.refused, ending.missing) == ([], [], [])
    alone = recorded(packets, plain, START_NS)
    assert made.names == alone.names
    for stream in alone.streams:
        np.testing.assert_array_equal(made[stream.name].time_s, stream.time_s)
        for name, rows in stream.values.items():
            np.testing.assert_array_equal(made[stream.name].values[name], rows)

    found = channels(tmp_path / "today")
    first = json.loads(packets[0].data)["device"]
    assert list(found) == ["erg", "erg/stroke", f"radio/{first}"]
    assert found[f"radio/{first}"].values["battery_percent"].tolist() == [77.0]
    # arrivals are whole nanoseconds
    np.testing.assert_allclose(found["erg"].arrival_s, 0.2 * np.arange(20), rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(found["erg"].clock_s, 50.0 + 0.2 * np.arange(20))
    np.testing.assert_array_equal(found["erg"].values["speed_m_s"], 4.0 + 0.01 * np.arange(20))
    time_s, speed_m_s = found["erg"].of("speed_m_s")
    # readings wait while the clock of the device settles, and none is lost
    np.testing.assert_allclose(time_s, 0.2 * np.arange(20), rtol=0.0, atol=1e-8)
    np.testing.assert_array_equal(speed_m_s, 4.0 + 0.01 * np.arange(20))
    assert found["erg/stroke"].values["state"].tolist() == ["s0", "s1", "s2", "s3"]

    told = health(session, {}, recorder, 10**9, 4.0)
    devices = {device["channel"]: device for device in told["devices"]}
    assert devices["erg"]["values"] == {"speed_m_s": 4.19}
    assert devices["erg/stroke"]["values"] == {"state": "s3"}
    # a battery has its own place, and what a sensor takes is no channel
    assert devices[f"radio/{first}"]["values"] == {}
    assert devices[f"radio/{first}"]["battery_percent"] == 77.0


def test_devices_alone_are_recorded_without_a_recording(sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    rig = Rig("sculler", None, {"erg": Source("erg", "test-json", "udp")}, ())
    place = LiveFolder.create(tmp_path / "today", rig, None, START_NS)
    recorder = Recorder(place.disk)
    recorder.write(extra(1.0, "", 0.0, heart_rate_per_min=150.0))
    recorder.close()
    made = place.finish(sculler).recording
    assert made is None
    assert channels(place.path)["erg"].values["heart_rate_per_min"].tolist() == [150.0]


def test_what_an_exchanged_unit_feeds_is_no_channel_any_more(sculler, rowed, monkeypatch):
    with_test_format(monkeypatch)
    rig = rig_of(sculler, rowed)
    kept = []
    packets = packets_of(rowed)
    unit = next(feed for feed in rig.feeds if feed.kind == "imu")
    told = [json.loads(p.data) for p in packets]
    renamed = [
        Packet(p.source, p.address, p.channel, p.arrival_ns, json.dumps({**t, "device": "new"}).encode())
        for p, t in zip(packets, told, strict=True)
        if t["device"] == unit.stream
    ]
    half = len(renamed) // 2
    order = command(renamed[half].arrival_ns - 1, "assign", stream=unit.stream, device="new")
    made = recorded([*renamed[:half], order, *renamed[half:]], rig, START_NS, kept.append)
    assert len(kept) == half
    assert {one.channel for one in kept} == {"radio/new"}
    assert set(kept[0].values) == set(unit.values)
    assert made.names == (unit.stream,)
