"""Emulated devices that feed no sensor: what they sent stands in the channels, with its values and its times."""

import math
from dataclasses import replace

import numpy as np
import pytest

import oarlock
from oarlock.live.channel_tables import Channels, channels
from oarlock.live.rig import Rig, Source
from oarlock.live.session import LiveSession
from oarlock.live.simulated_devices import Faults
from oarlock_lab.emulators import nmea
from oarlock_lab.emulators.emulated import Destination
from oarlock_lab.emulators.rower import Rowing
from oarlock_lab.soak.loopback import FAULTY, LATE_S, PERFECT, START_NS, emulated_by, packets_of

SECONDS = 30.0
POUND_N = 4.4482216152605


def asked(name, faults=PERFECT, seconds=SECONDS, seed=1, **place):
    time_s = np.array([0.0, seconds])
    recording = oarlock.Recording([oarlock.recording.ScalarStream("time", time_s, time_s)])
    return emulated_by(name, recording, faults, seed, Destination(**place))


def heard(kind, emulated, model, folder, packets=None):
    """The channels that a session has of a device."""
    wired = kind.device.wiring(emulated)
    sources = {
        own.source: Source(own.source, wired.format, own.transport, own.options, wired.decoder)
        for own in wired.senders.values()
    }
    session, kept = LiveSession(Rig(model.name, None, sources, ()), model, START_NS), Channels()
    session.intake.keep = kept.take
    for packet in packets_of(kind, emulated) if packets is None else packets:
        assert session.take(packet) == []
    assert all(session.intake.damaged(source) == 0 for source in sources)
    kept.save(folder / "channels")
    return channels(folder)


def assert_near(found, expected, steps):
    """Each quantity is as it was sent, to half of what one count of its message is."""
    for name, step in steps.items():
        time_s, values = found[name]
        told = np.array([expected(t)[name] for t in time_s])
        np.testing.assert_allclose(values, told, rtol=0.0, atol=0.5 * step + 1e-9, err_msg=name)


def by_arrival(channel):
    """Quantity -> times of sending, and values."""
    return {
        name: (
            channel.arrival_s[np.isfinite(rows)] - LATE_S,
            rows[np.isfinite(rows)],
        )
        for name, rows in channel.values.items()
        if rows.dtype == float and rows.ndim == 1
    }


def test_a_gps_receiver(sculler, tmp_path):
    found = heard(*asked("nmea"), sculler, tmp_path)
    assert list(found) == ["gps", "gps/vtg"]
    for channel in found.values():
        np.testing.assert_allclose(channel.arrival_s, np.arange(301) / 10 + LATE_S, rtol=0.0, atol=1e-9)
        assert_near(
            by_arrival(channel),
            lambda t: vars(nmea.fix(t)),
            {"speed_m_s": 0.001 * 1852 / 3600, "course_deg": 0.1},
        )
    gps = found["gps"]
    places = {"latitude_deg": 1e-5 / 60, "longitude_deg": 1e-5 / 60}
    assert_near(by_arrival(gps), lambda t: vars(nmea.fix(t)), places)
    np.testing.assert_allclose(gps.clock_s - nmea.STARTED.timestamp(), np.arange(301) / 10, atol=1e-6)
    # with perfect clocks a fix has the time at which it would arrive soonest, and none is lost while the clock settles
    np.testing.assert_allclose(gps.time_s, gps.arrival_s, rtol=0.0, atol=1e-6)


def test_the_times_of_fixes_that_come_late_and_in_bursts(sculler, tmp_path):
    kind, emulated = asked("nmea", FAULTY, seconds=60.0)
    gps = heard(kind, emulated, sculler, tmp_path)["gps"]
    share = len(gps.time_s) / 601
    assert 0.9 < share < 1.0
    known = np.isfinite(gps.time_s)
    true_s = gps.clock_s[known] - nmea.STARTED.timestamp() + LATE_S
    assert (gps.arrival_s[known] - true_s).max() > 0.2
    # what a forearm turns in 5 ms is 2 deg
    assert np.abs(gps.time_s[known] - true_s).max() < 0.005


STATUS = {
    "elapsed_s": 0.01,
    "distance_m": 0.1,
    "speed_m_s": 0.001,
    "pace_s_per_500_m": 0.01,
    "rate_per_min": 1.0,
    "drag_factor": 1.0,
    "energy_kcal": 1.0,
}
STROKE = {
    "elapsed_s": 0.01,
    "distance_m": 0.1,
    "handle_travel_m": 0.01,
    "drive_time_s": 0.01,
    "recovery_time_s": 0.01,
    "distance_per_stroke_m": 0.01,
    "peak_force_n": 0.1 * POUND_N,
    "mean_force_n": 0.1 * POUND_N,
    "work_j": 0.1,
    "stroke_number": 1.0,
}


def test_a_pm5(sculler, tmp_path):
    found = heard(*asked("pm5"), sculler, tmp_path)
    assert list(found) == ["pm5/drive", "pm5/status", "pm5/stroke"]
    rower = Rowing()
    assert_near(by_arrival(found["pm5/status"]), rower.values, STATUS)
    drive = found["pm5/drive"]
    assert_near(by_arrival(drive), rower.values, STROKE | {"power_w": 1.0, "energy_rate_kcal_per_h": 1.0})
    assert_near(by_arrival(found["pm5/stroke"]), rower.values, STROKE)
    # status each 250 ms; strokes of 2.5 s, the first drive of 0.8 s
    elapsed_s = by_arrival(found["pm5/status"])["drag_factor"][0]
    np.testing.assert_allclose(elapsed_s, np.arange(len(elapsed_s)) / 4, atol=1e-9)
    assert len(elapsed_s) >= 4 * (SECONDS - rower.stroke_s)
    time_s, curves = drive.of("handle_force_n")
    np.testing.assert_allclose(time_s - LATE_S, 0.8 + 2.5 * np.arange(12), atol=1e-8)
    np.testing.assert_allclose(curves, np.tile(rower.force_n(), (12, 1)), rtol=0.0, atol=0.5 * POUND_N)
    ends_s = found["pm5/stroke"].of("stroke_number")[0] - LATE_S
    np.testing.assert_allclose(ends_s, 2.5 * np.arange(1, 13), atol=2e-6)


def test_a_machine_of_the_fitness_service(sculler, tmp_path):
    erg = heard(*asked("ftms"), sculler, tmp_path)["erg"]
    steps = {
        "distance_m": 1.0,
        "pace_s_per_500_m": 1.0,
        "power_w": 1.0,
        "elapsed_s": 1.0,
        "rate_per_min": 0.5,
        "stroke_number": 1.0,
        "energy_kcal": 1.0,
        "energy_rate_kcal_per_h": 1.0,
    }
    np.testing.assert_allclose(erg.arrival_s, np.arange(31) + LATE_S, atol=1e-9)
    assert_near(by_arrival(erg), Rowing().values, steps)
    assert not np.isnan(np.column_stack([erg.values[name] for name in steps])).any()


def test_a_belt(sculler, tmp_path):
    belt = heard(*asked("heart_rate"), sculler, tmp_path)["belt"]
    seconds = np.arange(1, 31)
    np.testing.assert_allclose(belt.arrival_s, seconds + LATE_S, atol=1e-9)
    expected = [150.0 + 5.0 * math.sin(2.0 * math.pi * second / 30.0) for second in seconds]
    np.testing.assert_allclose(belt.values["heart_rate_per_min"], expected, rtol=0.0, atol=0.5)
    beats_s = belt.values["rr_s"]
    assert np.nanmax(np.abs(60.0 / beats_s - np.array(expected)[:, None])) < 0.5
    assert abs(np.nansum(beats_s) - SECONDS) < 1.0


def test_open_rowing_monitors_page(sculler, tmp_path):
    erg = heard(*asked("open_rowing_monitor"), sculler, tmp_path)["erg"]
    rower = Rowing()
    exact = dict.fromkeys(
        ("elapsed_s", "distance_m", "speed_m_s", "power_w", "drive_time_s", "peak_force_n"), 0.0
    )
    assert_near(by_arrival(erg), rower.values, exact)
    np.testing.assert_allclose(erg.arrival_s, np.arange(151) / 5 + LATE_S, atol=1e-9)
    np.testing.assert_allclose(erg.clock_s - erg.clock_s[0], np.arange(151) / 5, atol=1e-6)
    _, curves = erg.of("handle_force_n")
    np.testing.assert_allclose(curves, np.tile(rower.force_n(), (len(curves), 1)), rtol=1e-12)
    assert set(erg.values["stroke_state"]) == {"Drive", "Recovery"}


def test_open_rowing_monitors_messages_to_a_broker(sculler, tmp_path):
    erg = heard(*asked("open_rowing_monitor_mqtt"), sculler, tmp_path)["erg"]
    rower = Rowing()
    np.testing.assert_allclose(erg.arrival_s - LATE_S, 2.5 * np.arange(1, 13) - 1e-3, atol=1e-9)
    assert set(erg.address) == {"OpenRowingMonitor/erg/metrics"}
    names = (*STROKE, "power_w", "pace_s_per_500_m", "drag_factor")
    assert_near(by_arrival(erg), rower.values, {name: 1e-5 for name in names if name != "work_j"})
    np.testing.assert_allclose(erg.values["handle_force_n"][3], rower.force_n(), rtol=0.0, atol=5e-4)
    assert "heart_rate_per_min" not in erg.values


@pytest.mark.parametrize("name", ["ftms", "heart_rate", "nmea", "open_rowing_monitor", "pm5"])
def test_delays_and_losses_keep_the_order(name):
    kind, emulated = asked(name, Faults(least_ms=5.0, jitter_ms=30.0, loss=0.1, burst=2), seconds=60.0)
    due_s = [one.due_s for one in kind.device.messages(emulated)]
    whole = [one.due_s for one in kind.device.messages(replace(emulated, faults=PERFECT))]
    assert due_s == sorted(due_s)
    assert 0.7 * len(whole) < len(due_s) < len(whole)


@pytest.mark.parametrize("name", ["ftms", "heart_rate", "nmea", "open_rowing_monitor_mqtt", "pm5"])
def test_without_an_end_they_go_on(name):
    kind, emulated = asked(name, seconds=1.0)
    for _, message in zip(range(500), kind.device.messages(replace(emulated, period_s=1.0)), strict=False):
        last_s = message.due_s
    assert last_s > 20.0
