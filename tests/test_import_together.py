"""`oarlock import FOLDER --together`: a file for each unit becomes one recording."""

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.formats.together import joined
from oarlock.recording.epoch import CLOCK_KEY
from refusals import assert_refused
from test_table import HEADER, columns_of, table


@pytest.fixture
def folder(tmp_path):
    """A table of text for each unit, as a logger writes them that knows nothing of bodies."""
    place = tmp_path / "tuesday"
    place.mkdir()
    for name in ("Thorax", "upper-arm_r"):
        (place / f"{name}.csv").write_text(table(HEADER, columns_of()))
    return place


def part(name, start_s=0.0, zero=None, stream="imu"):
    time_s = start_s + np.arange(5) / 10
    clock = {} if zero is None else {CLOCK_KEY: {"kind": "utc", "zero": zero}}
    return name, oarlock.Recording([oarlock.recording.ImuStream(stream, time_s, np.ones((5, 3)))], clock)


def test_files_of_a_folder_are_units_of_one_recording(folder, tmp_path):
    assert "--together" in run("import", folder, status=1).stdout
    out = tmp_path / "rec"
    run("import", folder, "--together", "--out", out, "--no-questions")
    assert oarlock.load_recording(out).names == ("thorax", "upper_arm_r")
    run("import", folder, "--together", "--all", status=2)


def test_stamps_count_from_one_zero_where_all_files_tell_the_time(tmp_path):
    first = part("a", zero="2026-05-01T10:00:00.000000000Z")
    second = part("b", zero="2026-05-01T10:00:00.250000000Z")
    found = joined([first, second])
    np.testing.assert_allclose(found.sensor("b").time_s, 0.25 + np.arange(5) / 10)
    assert found.epoch == "2026-05-01T10:00:00.000000000Z"
    assert "calibrate clocks" in joined([first, part("b")]).meta["source"]["notes"][-1]


def test_files_that_were_not_measured_together_are_refused():
    assert_refused(
        lambda: joined([part("a"), part("b", start_s=9.0)]), '"b" begins 8.6 s after "a" ends', "--all"
    )
    assert_refused(lambda: joined([part("Left Arm"), part("left arm")]), "left_arm", "rename a file")


def test_a_file_of_several_units_keeps_their_names():
    two = oarlock.Recording([*part("", stream="hand")[1].streams, *part("", stream="foot")[1].streams])
    found = joined([("first", two), part("head"), ("second", two)])
    assert found.names == ("first_hand", "first_foot", "head", "second_hand", "second_foot")
