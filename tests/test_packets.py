"""Counters that begin again, clocks that wrap, and packets that never arrive."""

import json

import numpy as np
import pytest

from command_line import run
from oarlock import Recording, load_recording
from oarlock.formats.csv import read_csv
from oarlock.recording import ImuStream
from oarlock.recording.packets import (
    expected_quantity_rows,
    lost_packets,
    missing_packets,
    missing_share,
    quantity_rates,
)
from oarlock.recording.plausibility import plausibility
from refusals import assert_refused

RATE_HZ = 100
MAPPING = """format = 1
[[file]]
path = "unit.csv"
{time}
counter = {{ column = "PacketCounter", wraps_at = 65536 }}
[[file.sensor]]
name = "back"
gyro = {{ columns = ["gx", "gy", "gz"], unit = "rad/s" }}
"""
FINE = 'time = { column = "SampleTimeFine", unit = "us", wraps_at = 4294967296 }'
TICKS = 'time = { column = "PacketCounter", unit = "ticks", tick_s = 0.01, wraps_at = 65536 }'
ROUNDING_S = 1e-6
"""A millionth of a second is the unit of the column."""


@pytest.fixture
def unit(tmp_path):
    def write(count=200, start=0, lost=(), time=FINE, first_us=0, fix=None):
        """A unit's export: packets from `start` on, without those whose index is lost."""
        index = np.array([k for k in range(count) if k not in lost])
        rows = [
            f"{(start + k) % 65536},{(first_us + k * 10_000) % 2**32},{0.1 * np.sin(k / 9):.4f},0.01,0.02"
            for k in index
        ]
        if fix is not None:
            rows = fix(rows)
        (tmp_path / "unit.csv").write_text("PacketCounter,SampleTimeFine,gx,gy,gz\n" + "\n".join(rows) + "\n")
        (tmp_path / "mapping.toml").write_text(MAPPING.format(time=time))
        return tmp_path / "mapping.toml"

    return write


def test_a_device_clock_goes_on_where_it_wraps(unit):
    stream = read_csv(unit(first_us=2**32 - 500_000))["back"]
    assert np.allclose(np.diff(stream.time_s), 1 / RATE_HZ, atol=ROUNDING_S)


def test_a_counter_goes_on_where_it_wraps_and_nothing_is_missing(unit):
    recording = read_csv(unit(start=65_500))
    assert missing_packets(recording, recording["back"]) == 0
    assert not [f for f in plausibility(recording) if "packet" in f.message]


def test_a_counter_can_be_the_clock(unit):
    stream = read_csv(unit(start=65_500, lost=(50, 51), time=TICKS))["back"]
    assert len(stream) == 198
    assert np.diff(stream.time_s).max() == pytest.approx(0.03, abs=ROUNDING_S)


@pytest.mark.parametrize("start", [0, 65_450])
def test_missing_packets_are_counted_and_stay_missing(unit, start):
    recording = read_csv(unit(start=start, lost=(40, 100, 101, 102, 150)))
    (note,) = [f for f in plausibility(recording) if "packet" in f.message]
    assert note.severity == "note"
    assert note.message == "5 packets missing in 3 places by its counter, longest 30 ms at 1.0 s."
    assert len(recording["back"]) == 195


def test_what_the_counter_found_is_kept_in_the_folder_and_cut_with_the_recording(unit, tmp_path):
    read_csv(unit(lost=(40, 100, 101))).save(tmp_path / "rec")
    back = load_recording(tmp_path / "rec")
    assert missing_packets(back, back["back"]) == 3
    late = back.slice(0.7)
    assert missing_packets(late, late["back"]) == 2


def test_without_a_counter_gaps_between_stamps_tell():
    time_s = np.delete(np.arange(500) / RATE_HZ, [100, 200, 201])
    recording = Recording([ImuStream("back", time_s, gyro_rad_s=np.zeros((len(time_s), 3)))])
    lost = lost_packets(recording, recording["back"])
    assert lost is not None and lost.text() == "3 packets missing in 2 places, longest 20 ms at 2.0 s."


def test_a_slow_quantity_is_counted_against_its_own_rate():
    """A magnetometer at 20 Hz beside a gyroscope at 100 Hz, which lost three readings of its own."""
    time_s = np.arange(1000) / 100.0
    gyro = np.ones((1000, 3))
    mag = np.full((1000, 3), np.nan)
    mag[::5] = 30.0
    mag[[100, 105, 500]] = np.nan
    recording = Recording([ImuStream("shank", time_s, gyro_rad_s=gyro, mag_ut=mag)])
    (stream,) = recording
    assert expected_quantity_rows(recording, stream) == {"gyro_rad_s": 1000, "mag_ut": 200}
    assert quantity_rates(recording, stream)["mag_ut"] == pytest.approx(20.0)
    assert missing_share(recording, stream) == pytest.approx(3 / 1200)
    assert [f.message for f in plausibility(recording) if "mag_ut" in f.message]
    whole = ImuStream("foot", time_s, gyro_rad_s=gyro, mag_ut=np.where(np.isnan(mag), 30.0, mag))
    gap = ImuStream("hand", time_s, gyro_rad_s=np.where(np.arange(1000)[:, None] // 300 == 1, np.nan, gyro))
    both = Recording([whole, gap])
    assert missing_share(both, both["foot"]) == 0.0
    assert missing_share(both, both["hand"]) == pytest.approx(0.3)


def test_irregular_stamps_tell_nothing_of_packets():
    time_s = np.cumsum(np.random.default_rng(0).exponential(0.01, 500))
    recording = Recording([ImuStream("back", time_s, gyro_rad_s=np.zeros((len(time_s), 3)))])
    assert lost_packets(recording, recording["back"]) is None


def test_a_packet_that_is_there_twice_is_refused_with_its_line(unit):
    def twice(rows):
        cells = rows[20].split(",")
        cells[0] = rows[19].split(",")[0]
        return [*rows[:20], ",".join(cells), *rows[21:]]

    assert_refused(lambda: read_csv(unit(fix=twice)), "unit.csv:22", "PacketCounter", "is duplicated")


def test_a_clock_that_wraps_unannounced_is_refused_with_the_way_out(unit):
    mapping = unit(first_us=2**32 - 500_000, time='time = { column = "SampleTimeFine", unit = "us" }')
    assert_refused(lambda: read_csv(mapping), "time.wraps_at")


@pytest.mark.parametrize(
    ("time", "said"),
    [
        (FINE.replace("4294967296", "1000"), "expected 0 to less than that"),
        (FINE.replace("4294967296", "-1"), "65536 or 4294967296"),
        (TICKS.replace(", tick_s = 0.01", ""), "tick_s"),
        (FINE.replace('unit = "us"', 'unit = "us", tick_s = 1'), "go together"),
        ('time = { column = "SampleTimeFine", unit = "epoch_us", wraps_at = 9 }', "does not wrap"),
    ],
)
def test_a_mapping_that_makes_no_sense_is_refused(unit, time, said):
    assert_refused(lambda: read_csv(unit(time=time)), said)


def test_import_reports_missing_packets(unit, tmp_path):
    mapping = unit(lost=(40, 100, 101))
    shown = run("import", "csv", mapping, "--out", tmp_path / "a").output
    assert "back: 3 packets missing in 2 places" in shown
    document = json.loads(run("import", "csv", mapping, "--out", tmp_path / "b", "--json").stdout)
    assert document["streams"][0]["missing_packets"] == 3
