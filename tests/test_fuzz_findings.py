"""What fuzzing found in readers and settings, each kept as a test of its own."""

import struct

import pytest

import oarlock
from oarlock.errors import DataError
from oarlock.io.apdm import read_apdm
from oarlock.io.broad import read_broad
from test_markers_io import NEXUS, c3d_file


@pytest.mark.parametrize("field", ["parameters", "mounts", "mag_offsets_ut"])
@pytest.mark.parametrize("given", ["0", 3, [("a", 1.0)]])
def test_a_calibration_of_something_else_than_names_and_values(field, given):
    with pytest.raises(DataError, match=f"calibration, {field}"):
        oarlock.Calibration(**{field: given})


def test_a_nexus_export_whose_section_begins_behind_a_tab(tmp_path):
    file = tmp_path / "nexus.csv"
    file.write_text(NEXUS.replace("Trajectories", "\tTrajectories", 1), encoding="utf-8")
    with pytest.raises(DataError, match='begins with "Trajectories"'):
        oarlock.load_markers(file)


def test_an_apdm_export_whose_first_line_is_empty(tmp_path):
    file = tmp_path / "units.csv"
    file.write_text("\nTime,x\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"units\.csv:1: is empty"):
        read_apdm(file)


@pytest.mark.parametrize("content", [b"", b"\x00" * 4, b" " * 126, b"M" * 130])
def test_a_matlab_file_that_is_none(tmp_path, content):
    file = tmp_path / "trial.mat"
    file.write_bytes(content)
    with pytest.raises(DataError, match="MATLAB"):
        read_broad(file)


@pytest.mark.parametrize("seeds", [0, 10**9, 10**20])
def test_a_study_of_more_seeds_than_anybody_waits_for(tmp_path, seeds):
    file = tmp_path / "study.toml"
    file.write_text(f'format = 1\nmodel = "sculler"\nsimulator = "none"\nseeds = {seeds}\n', encoding="utf-8")
    with pytest.raises(DataError):
        oarlock.load_study(file)


@pytest.fixture
def c3d(tmp_path):
    c3d_file(tmp_path / "trial.c3d", ["A", "B"])
    return tmp_path / "trial.c3d"


def changed(file, at, value):
    content = bytearray(file.read_bytes())
    content[at : at + len(value)] = value
    file.write_bytes(content)


def test_a_c3d_header_that_announces_gigabytes(c3d):
    changed(c3d, 2, struct.pack("<H", 60_000))
    with pytest.raises(DataError, match="announces"):
        oarlock.load_markers(c3d)


def test_a_c3d_parameter_that_announces_gigabytes(c3d):
    content = c3d.read_bytes()
    labels = content.index(b"LABELS")
    dimensions = labels + len(b"LABELS") + 2 + 2
    changed(c3d, dimensions - 1, bytes([7]) + b"\xff" * 7)
    with pytest.raises(DataError, match="LABELS"):
        oarlock.load_markers(c3d)


def test_a_c3d_that_was_cut_off(c3d):
    content = c3d.read_bytes()
    c3d.write_bytes(content[: len(content) // 4])
    with pytest.raises(DataError, match=r"trial\.c3d"):
        oarlock.load_markers(c3d)
