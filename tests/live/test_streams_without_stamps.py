"""Streams whose devices send no time, and magnetometers in arbitrary units."""

import numpy as np
import pytest
from senders import START_NS

from oarlock.live.intake import Intake
from oarlock.live.reading import Packet, Reading
from oarlock.live.rig import Feed, Rig, Source, rig_document
from oarlock.live.session import LiveSession, command, recorded
from oarlock.storage.errors import DataError
from oarlock.storage.toml import toml_text

RIG = """format = 1
model = "sculler"
tie_clocks = false

[sources.radio]
format = "ximu3"
transport = "ble"

[streams.back]
source = "radio"
rate_hz = 100
mag_unit_ut = 48.5

[streams.seat]
source = "radio"
value = "value"
stamp_std_ms = 7.5
"""


class Listed:
    """Gives the readings that a test wrote."""

    damaged = 0

    def __init__(self, readings):
        self.readings = readings

    def decode(self, data, channel=""):
        return [self.readings[int(data)]]


def rig_of(*feeds, transport="ble"):
    return Rig("sculler", None, {"radio": Source("radio", "listed", transport)}, feeds)


def taken(rig, readings, arrival_s):
    """Readings of the model's sensors, and the intake."""
    intake = Intake(rig, START_NS, lambda source: Listed(readings))
    found = []
    for row, at_s in enumerate(arrival_s):
        found += intake.take(Packet("radio", "", "", START_NS + int(1e9 * at_s), str(row).encode()))
    return found, intake


def counted(rate_hz, rig_hz, seconds=60.0):
    """An encoder that counts its readings, 10 ms of jitter on the way."""
    rng = np.random.default_rng(3)
    count = np.arange(int(seconds * rate_hz))
    kept = rng.random(len(count)) > 0.05
    true_s = count[kept] / rate_hz
    arrival_s = np.maximum.accumulate(true_s + 2e-3 + rng.exponential(10e-3, len(true_s)))
    # Of readings that arrive at the same instant without a time, one can be used.
    arrival_s += 1e-6 * np.arange(len(arrival_s))
    readings = [Reading("", None, {"value": 0.1}, int(k)) for k in count[kept]]
    feed = Feed("seat", "scalar", "radio", "", ("value",), rig_hz)
    found, intake = taken(rig_of(feed), readings, arrival_s)
    found += intake.flush()
    off_s = np.array([one.time_s for one in found]) - true_s - 2e-3
    return true_s, off_s, intake


@pytest.mark.parametrize("rate_hz", [50.0, 50.1])
def test_a_counter_whose_rate_is_known_is_a_clock(rate_hz):
    true_s, off_s, intake = counted(rate_hz, 50.0)
    assert off_s[true_s < 10].std() > 8e-3
    assert np.abs(off_s[true_s > 25]).max() < 5e-3
    assert intake.stamp_stds() == {}


def test_a_counter_that_counts_something_else_is_none():
    true_s, off_s, intake = counted(50.0, 100.0)
    assert off_s[true_s > 25].std() > 8e-3
    assert intake.stamp_stds() == {"seat": 0.012}


def test_arrivals_are_as_uncertain_as_their_transport_or_as_the_rig_says():
    readings = [Reading("", None, {"value": 0.1, "back": (1.0, 0.0, 0.0, 0.0)}) for _ in range(3)]
    for transport, std_s in (("serial", 2e-3), ("udp", 5e-3), ("ble", 12e-3), ("another", 5e-3)):
        feeds = (
            Feed("seat", "scalar", "radio", "", ("value",)),
            Feed("l_oar_phi", "scalar", "radio", "", ("value",), stamp_std_s=0.02),
        )
        _, intake = taken(rig_of(*feeds, transport=transport), readings, [0.0, 0.1, 0.2])
        assert intake.stamp_stds() == {"seat": std_s, "l_oar_phi": 0.02}


def test_the_tracker_gets_the_uncertainty_of_stamps(sculler, monkeypatch):
    readings = [Reading("", None, {"value": 0.1}) for _ in range(3)]
    import oarlock.live.session as module

    monkeypatch.setattr(module, "_new_decoder", lambda source: Listed(readings))
    session = LiveSession(rig_of(Feed("seat", "scalar", "radio", "", ("value",), 50.0)), sculler, START_NS)
    session.take(Packet("radio", "", "", START_NS, b"0"))
    session.take(command(START_NS + 1, "track"))
    assert session.config.stamp_std_s == {"seat": 0.012}


def test_magnetometers_in_arbitrary_units_are_scaled_as_files_are(monkeypatch):
    rng = np.random.default_rng(5)
    fields = [tuple(row) for row in rng.normal(size=(200, 3)) + 3.0]
    readings = [Reading("", 0.01 * k, {"mag_arbitrary": one}) for k, one in enumerate(fields)]
    arrivals = 0.01 * np.arange(200) + 0.001

    def mags(unit):
        feed = Feed(
            "back", "imu", "radio", "", ("gyro_rad_s", "accel_m_s2", "mag_ut"), 100.0, mag_unit_ut=unit
        )
        rig = rig_of(feed)
        found, intake = taken(rig, readings, arrivals)
        return rig, np.array([one.values["mag_ut"] for one in found]), intake.mag_units["back"]

    _, given, unit = mags(20.0)
    np.testing.assert_allclose(given, 20.0 * np.array(fields), rtol=1e-12)
    assert not unit.is_learnt
    rig, learnt, unit = mags(None)
    assert unit.is_learnt
    assert unit.unit_ut == pytest.approx(50.0 / np.median(np.linalg.norm(fields[:50], axis=1)))
    np.testing.assert_allclose(learnt, unit.unit_ut * np.array(fields)[49:], rtol=1e-12)
    import oarlock.live.session as module

    monkeypatch.setattr(module, "_new_decoder", lambda source: Listed(readings))
    packets = [
        Packet("radio", "", "", START_NS + int(1e9 * s), str(k).encode()) for k, s in enumerate(arrivals)
    ]
    assert recorded(packets, rig, START_NS).meta["mag_scale"] == {"back": unit.unit_ut}


def test_the_rig_file_keeps_these_settings(sculler, tmp_path):
    (tmp_path / "rig.toml").write_text(RIG)
    rig = Rig.load(tmp_path / "rig.toml", sculler)
    assert (rig.ties_clocks, rig.feeds[0].mag_unit_ut, rig.feeds[1].stamp_std_s) == (False, 48.5, 7.5e-3)
    (tmp_path / "again.toml").write_text(toml_text(rig_document(rig)))
    assert Rig.load(tmp_path / "again.toml", sculler) == rig
    (tmp_path / "bad.toml").write_text(RIG.replace("7.5", "-7.5"))
    with pytest.raises(DataError, match=r"stamp_std_ms.*expected ms"):
        Rig.load(tmp_path / "bad.toml", sculler)
