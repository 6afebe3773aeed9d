"""Files of makers of inertial units with wounds at their readers: read, or refused with a reason."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import test_apdm_hdf5
import test_c3d_channels
import test_lines
import test_mcap
import test_ngimu
import test_xdf
import test_ximu3
from fuzz_wounds import feed
from oarlock.formats.devices.apdm import read_apdm
from oarlock.formats.devices.c3d import read_c3d
from oarlock.formats.devices.lines import HEADER, read_lines
from oarlock.formats.devices.mcap import read_mcap
from oarlock.formats.devices.ngimu import read_ngimu, read_ngimu_orientations
from oarlock.formats.devices.xdf import read_xdf
from oarlock.formats.devices.ximu3 import read_ximu3, read_ximu3_orientations
from refusals import assert_refused


@pytest.mark.parametrize("name", ["Inertial.csv", "Command.json"])
def test_ximu3_folders(name, tmp_path):
    for file in (test_ximu3.SAMPLE / test_ximu3.FOOT).iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    whole = (tmp_path / name).read_text(encoding="utf-8")
    feed(tmp_path / name, whole, lambda _: read_ximu3(tmp_path), lambda _: read_ximu3_orientations(tmp_path))


def test_ximu3_logs(tmp_path):
    rows = [test_ximu3.message("I", 2500 * k, 1.0, 2.0, 3.0, 0.1, 0.2, 0.9) for k in range(1, 9)]
    time = json.dumps({"time": "2026-01-01 00:00:00"}).encode() + b"\n"
    content = b"".join([test_ximu3.PING, time, *rows, test_ximu3.QUATERNION])
    feed(tmp_path / "log.ximu3", content, read_ximu3, read_ximu3_orientations)


@pytest.mark.parametrize("name", ["sensors.csv", "quaternion.csv", "Device.xml"])
def test_ngimu_folders(name, tmp_path):
    file = test_ngimu.unit(tmp_path, "Arm", "1") / name
    whole = file.read_text(encoding="utf-8")
    feed(file, whole, lambda _: read_ngimu(tmp_path), lambda _: read_ngimu_orientations(tmp_path))


def test_xdf_files(tmp_path):
    file = test_xdf.written(
        tmp_path,
        test_xdf.header(1, "float32", test_xdf.IMU, 100.0),
        test_xdf.header(2, "string", [("m", "")], name="Markers"),
        test_xdf.samples(1, "float32", [1.0, None, None], np.ones((3, 7))),
        test_xdf.offset(1, 1.0, -0.5),
        test_xdf.samples(2, "string", [1.02], [["go"]]),
        test_xdf.chunk(5, test_xdf.BOUNDARY),
        test_xdf.samples(1, "float32", [1.03, 1.04, 1.05], np.ones((3, 7))),
        test_xdf.offset(1, 2.0, -0.5),
    )
    feed(file, file.read_bytes(), lambda path: read_xdf(path).save(tmp_path / "rec", force=True))


def test_line_protocol(tmp_path):
    text = HEADER + "\n" + "".join(test_lines.line(2500 * k, k) for k in range(9))
    feed(tmp_path / "unit.csv", text, lambda file: read_lines(file).save(tmp_path / "rec", force=True))


def test_c3d_channels_of_files(tmp_path):
    file = tmp_path / "trial.c3d"
    test_c3d_channels.c3d_file(file)
    feed(file, file.read_bytes(), read_c3d, count=15)


def test_hdf5_files(tmp_path):
    file = test_apdm_hdf5.hdf5_file(tmp_path / "walk.h5")
    feed(file, file.read_bytes(), read_apdm, count=15)


def test_mcap_files(tmp_path):
    file = test_mcap.bag(tmp_path)
    feed(file, file.read_bytes(), read_mcap, count=15)


@pytest.mark.parametrize("read", [read_c3d, read_lines, read_mcap, read_ngimu, read_xdf, read_ximu3])
@pytest.mark.parametrize("place", ["", "nothing_here", "a folder", "a\x00b", "x" * 300, "empty", "noise"])
def test_places_that_hold_nothing(read, place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a folder").mkdir()
    Path("empty").touch()
    Path("noise").write_bytes(os.urandom(200))
    assert_refused(lambda: read(place))
