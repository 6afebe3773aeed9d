"""The line protocol: lines as docs/import.md describes them."""

import numpy as np
import pytest

from oarlock.formats.devices.lines import HEADER, find_lines, read_lines
from oarlock.formats.listing import listed
from refusals import assert_refused

READING = "0.1,-0.25,9.8,0.01,0.02,-3e-2"


def line(t_us, seq, mag=",20.5,0,-40"):
    return f"{t_us},{seq},{READING}{mag}\n"


def put(tmp_path, text, name="Left Hand.csv"):
    file = tmp_path / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


def test_values(tmp_path):
    recording = read_lines(
        put(tmp_path, HEADER + "\n" + line(2500, 7) + line(5000, 8, ",,,") + line(7500, 9))
    )
    (stream,) = recording
    assert stream.name == "left_hand"
    assert stream.time_s.tolist() == [0.0025, 0.005, 0.0075]
    assert stream.accel_m_s2[0].tolist() == [0.1, -0.25, 9.8]
    assert stream.gyro_rad_s[0].tolist() == [0.01, 0.02, -0.03]
    assert np.array_equal(stream.mag_ut[:, 0], [20.5, np.nan, 20.5], equal_nan=True)
    assert recording.meta["packets"]["left_hand"]["packets"] == []
    assert recording.meta["source"]["notes"] == []


def test_without_a_magnetometer(tmp_path):
    (stream,) = read_lines(put(tmp_path, line(0, 0, "") + line(10_000, 1, "")))
    assert list(stream.values) == ["gyro_rad_s", "accel_m_s2"]


@pytest.mark.parametrize("modulus", [2**8, 2**16, 2**32])
def test_counts_and_clocks_wrap(modulus, tmp_path):
    text = "".join(
        line((2**32 - 20_000 + 2500 * k) % 2**32, (modulus - 5 + k) % modulus) for k in range(20) if k != 9
    )
    recording = read_lines(put(tmp_path, text))
    (stream,) = recording
    assert np.allclose(np.diff(stream.time_s), [0.0025] * 8 + [0.005] + [0.0025] * 9, atol=1e-9, rtol=0)
    assert recording.meta["packets"]["left_hand"]["packets"] == [1.0]


def test_damaged_late_and_repeated_lines_are_counted(tmp_path):
    whole = "".join(line(2500 * k, k) for k in range(6))
    text = "9,-3e-2,20,1\n" + whole + "25,5,1.0\n" + line(20_000, 8) + line(17_500, 7) + line(20_000, 8)
    recording = read_lines(put(tmp_path, text + line(22_500, 9)[:-9]))
    assert len(recording["left_hand"]) == 7
    assert recording.meta["source"]["notes"] == [
        "3 lines are no whole samples and were left out.",
        "2 samples came late or twice and were left out.",
    ]
    assert recording.meta["packets"]["left_hand"]["packets"] == [2.0]


def test_line_ends_and_marks(tmp_path):
    text = "\ufeff" + (HEADER + "\n" + line(0, 0) + line(2500, 1)).replace("\n", "\r\n")
    assert len(read_lines(put(tmp_path, text))["left_hand"]) == 2


def test_what_is_refused(tmp_path):
    assert_refused(lambda: read_lines(put(tmp_path, "")), "Left Hand.csv", "0 of 0 lines")
    assert_refused(lambda: read_lines(put(tmp_path, HEADER)), "0 of 0 lines")
    assert_refused(lambda: read_lines(put(tmp_path, "a,b\n1,2\n")), "0 of 2 lines")
    assert_refused(
        lambda: read_lines(put(tmp_path, line(5000, 1) + line(0, 2))), "sample 2", "t_us is 0 after 5000"
    )
    assert_refused(lambda: read_lines(tmp_path / "nowhere"), "cannot be read")


def test_found_by_content(tmp_path):
    put(tmp_path, HEADER + "\n", "a.txt")
    put(tmp_path, "12,0.3\n" + line(5000, 1) + line(7500, 2), "b.log")
    put(tmp_path, "1,2,3,4,5,6,7,8\n2,4,3,4,5,6,7,8\n4,4,3,4,5,6,7,8\n", "c.csv")
    assert [found.path.name for found in find_lines(listed(tmp_path))] == ["a.txt", "b.log"]
