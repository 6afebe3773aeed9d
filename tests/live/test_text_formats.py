"""Lines of text: our own protocol, JSON, NMEA. Values beside what published or hand-made lines say."""

import json
import math
from functools import reduce
from operator import xor

import pynmea2
import pytest

from decoded import damaged, near, one, readings
from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.messages import MOST_BYTES
from oarlock.live.decoders.nmea import sentence

RMC = b"$GNRMC,123519.20,A,4807.03812,N,01131.00034,E,9.720,084.4,230394,,,A*42\r\n"
VTG = b"$GPVTG,084.4,T,077.8,M,009.7,N,018.0,K*49\r\n"


def test_a_line_of_the_protocol():
    found = one("lines", b"2500,1,0.1,0,9.8,0,0,0.02,20,0,-40\n")
    assert (found.device, found.clock_s, found.count) == ("", 0.0025, 1)
    assert found.values == {
        "accel_m_s2": (0.1, 0.0, 9.8),
        "gyro_rad_s": (0.0, 0.0, 0.02),
        "mag_ut": (20.0, 0.0, -40.0),
    }


def test_lines_without_magnetometer_and_with_the_names_of_columns():
    found = readings("lines", b"t_us,seq,ax,ay,az,gx,gy,gz\r\n0,1,1,2,3,4,5,6\r\n10,2,1,2,3,4,5,6,,,\n")
    assert [set(r.values) for r in found] == [{"accel_m_s2", "gyro_rad_s"}] * 2


def test_the_microseconds_wrap_at_32_bits_and_the_count_where_it_does():
    times = [2**32 - 10_000, 2**32 - 5_000, 0, 5_000]
    found = readings("lines", *(b"%d,%d,1,2,3,4,5,6\n" % (t, (254 + k) % 256) for k, t in enumerate(times)))
    assert [round(1e6 * r.clock_s) - times[0] for r in found] == [0, 5000, 10_000, 15_000]
    assert [r.count for r in found] == [254, 255, 256, 257]


def test_a_unit_that_sends_64_bits_does_not_wrap():
    found = readings("lines", *(b"%d,0,1,2,3,4,5,6\n" % t for t in (2**32 - 1, 2**32, 2**33, 2**33 + 7)))
    assert [round(1e6 * r.clock_s) for r in found] == [2**32 - 1, 2**32, 2**33, 2**33 + 7]


def test_a_late_line_is_no_wrap():
    found = readings(
        "lines", *(b"%d,%d,1,2,3,4,5,6\n" % (t, n) for t, n in ((5000, 9), (2500, 8), (7500, 10)))
    )
    assert [r.count for r in found] == [9, 8, 10]
    assert [r.clock_s for r in found] == [0.005, 0.0025, 0.0075]


@pytest.mark.parametrize(
    "line",
    [
        b"hello",
        b"1,2,3",
        b"0,1,1,2,3,4,5,inf",
        b"-1,1,1,2,3,4,5,6",
        b"0,1,1,2,3,4,5,6,7",
        b"\xff\x00",
        b'{"gyro_rad_s": [0, 0]}',
        b'{"gyro_rad_s": 1}',
        b'{"gyro_rad_s": "fast"}',
        b'{"gyro_rad_s": [0, NaN, 0]}',
        b'{"gyro_rad_s": [0, 1e999, 0]}',
        b'{"quat_wxyz": [0, 0, 0, 0]}',
        b'{"t_us": 1}',
        b'{"t_us": -1, "speed_m_s": 1}',
        b'{"t_us": true, "speed_m_s": 1}',
        b'{"clock_s": [1], "speed_m_s": 1}',
        b'{"device": 3, "speed_m_s": 1}',
        b'{"markers": [1]}',
        b'{"markers": {"a": [1, 2]}}',
        b'{"a": {}}',
        b"{" * 3000,
        b"1" * (MOST_BYTES + 1),
    ],
)
def test_a_line_that_is_no_sample_is_counted(line):
    assert damaged("lines", line + b"\n") == 1


def test_json_lines():
    sent = {
        "device": "hand",
        "t_us": 2500,
        "seq": 7,
        "gyro_rad_s": [0, 0, 0.02],
        "temperature_deg_c": 31,
        "a": None,
    }
    found = one("lines", json.dumps(sent).encode() + b"\n")
    assert (found.device, found.clock_s, found.count) == ("hand", 0.0025, 7)
    assert found.values == {"gyro_rad_s": (0.0, 0.0, 0.02), "temperature_deg_c": 31.0}
    assert one("lines", b'{"clock_s": 1.5, "note": "go"}\n').values == {"note": "go"}


def test_devices_of_json_lines_have_their_own_clocks():
    lines = [
        {"device": d, "t_us": t, "speed_m_s": 1} for d, t in (("a", 2**32 - 1), ("b", 5), ("a", 1), ("b", 6))
    ]
    found = readings("lines", *(json.dumps(line).encode() + b"\n" for line in lines))
    assert [round(1e6 * r.clock_s) for r in found] == [2**32 - 1, 5, 2**32 + 1, 6]


def test_so_many_devices_are_damage():
    lines = [b'{"device": "%d", "speed_m_s": 1}' % k for k in range(100)]
    decoder = DECODERS["lines"].decoder()
    assert sum(len(decoder.decode(line + b"\n")) for line in lines) == 64
    assert decoder.damaged == 36


def test_markers():
    line = b'{"markers": {"wrist": [0.1, 0.2, 0.9], "elbow": null, "hip": [1, 2, 3]}, "frame": 12, "t_us": 2500}\n'
    wrist, hip = readings("lines", line)
    assert (wrist.device, wrist.values, wrist.count, wrist.clock_s) == (
        "wrist",
        {"position_m": (0.1, 0.2, 0.9)},
        12,
        0.0025,
    )
    assert (hip.device, hip.values) == ("hip", {"position_m": (1.0, 2.0, 3.0)})


def test_a_datagram_may_end_without_its_end():
    packets = (b"0,1,1,2,3,4,5,6", b"10,2,1,2,3,4,5,6\n20,3,1,2,3,4,5,6")
    assert [r.count for r in readings("lines", *packets, transport="udp")] == [1, 2, 3]


def test_rmc():
    found = one("nmea", RMC)
    assert found.clock_s == pytest.approx(764_426_119.2, abs=1e-6)  # 1994-03-23 12:35:19.2
    assert found.values["speed_m_s"] == pytest.approx(5.0004, abs=1e-6)
    assert found.values["latitude_deg"] == pytest.approx(48.117302, abs=1e-9)
    assert found.values["longitude_deg"] == pytest.approx(11.5166723, abs=4e-8)
    assert found.values["course_deg"] == 84.4


def test_vtg():
    found = one("nmea", VTG)
    assert (found.device, found.clock_s) == ("vtg", None)
    assert found.values == {"speed_m_s": near(5.0), "course_deg": 84.4}


def test_a_receiver_without_a_fix_tells_it():
    assert one("nmea", sentence("GNRMC,,V,,,,,,,,,,N")).values == {"fix": "none"}
    assert readings("nmea", sentence("GPVTG,,T,,M,,N,,K,N"), sentence("GPGSV,1,1,00")) == []


def test_southern_and_western_places_are_negative():
    found = one("nmea", sentence("GPRMC,000000,A,3330.0,S,07030.0,W,,,010126,,"))
    assert (found.values["latitude_deg"], found.values["longitude_deg"]) == (-33.5, -70.5)
    assert found.clock_s == 1767225600.0


@pytest.mark.parametrize(
    "line",
    [
        RMC.replace(b"9.720", b"9.721"),
        RMC.replace(b"*42", b"*4"),
        RMC[1:],
        sentence("GNRMC,123519.20,A,x,N,01131.0,E,9.7,84,230394,,,A"),
        sentence("GNRMC,996199,A,4807.0,N,01131.0,E,9.7,84,230394,,,A"),
        sentence("GNRMC,123519,A,4807.0,N,01131.0,E,nan,84,230394,,,A"),
        sentence("GNRMC,123519,A"),
    ],
)
def test_a_damaged_sentence_is_counted(line):
    assert damaged("nmea", line) == 1


def test_against_pynmea2():
    for speed, side in ((0.004, "N"), (11.93, "S")):
        sent = sentence(f"GPRMC,235959.90,A,4503.5,{side},00959.99,W,{speed},359.9,311299,,,A")
        told, found = pynmea2.parse(sent.decode().strip()), one("nmea", sent)
        assert found.clock_s == pytest.approx(told.datetime.timestamp(), abs=1e-6)
        assert found.values["latitude_deg"] == pytest.approx(told.latitude, abs=1e-12)
        assert found.values["longitude_deg"] == pytest.approx(told.longitude, abs=1e-12)
        assert found.values["speed_m_s"] == pytest.approx(told.spd_over_grnd * 1852 / 3600)


def test_the_checksum_is_that_of_the_vectors():
    assert sentence(RMC.decode()[1:].partition("*")[0]) == RMC
    assert reduce(xor, VTG[1 : VTG.index(b"*")]) == 0x49
    assert math.isclose(9.720 * 1852 / 3600, 5.0004, rel_tol=1e-9)
