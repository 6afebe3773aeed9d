"""Real files with wounds at every reader: read, or refused with a reason."""

import os
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.io import savemat

import oarlock
import test_io_dot
import test_io_mvnx
import test_io_shimmer
from fuzz_campaign import answered, campaign
from fuzz_wounds import byte_wounds, feed, wounded, wounded_bytes, wounds
from oarlock.formats.csv import read_csv
from oarlock.formats.datasets import mat
from oarlock.formats.datasets.broad import read_broad, read_broad_reference
from oarlock.formats.datasets.dfjimu import read_dfjimu, read_dfjimu_reference
from oarlock.formats.datasets.qmt import read_qmt
from oarlock.formats.devices.apdm import read_apdm, read_apdm_orientations
from oarlock.formats.devices.dot import find_dot, read_dot
from oarlock.formats.devices.mtmanager import find_mtmanager, read_mtmanager
from oarlock.formats.devices.mvnx import find_mvnx, read_mvnx
from oarlock.formats.devices.shimmer import find_shimmer, read_shimmer
from oarlock.formats.devices.sto import find_sto, read_sto
from oarlock.formats.listing import listed
from oarlock.model.shipped_files import model_path
from oarlock.rowing import SIMULATORS
from oarlock.storage.folder_writer import MANIFEST
from test_io_folder import example
from test_markers_io import NEXUS, QUALISYS, c3d_file

ROOT = Path(__file__).parents[1]
ROWS = 25
"""Long files are cut, so that wounds meet headers and rows alike."""


def first_lines(file, count=ROWS, encoding="utf-8"):
    return "".join(file.read_text(encoding=encoding).splitlines(keepends=True)[:count])


def put(file, text, encoding="utf-8"):
    file.write_bytes(text.encode(encoding, errors="replace" if encoding != "utf-8" else "surrogatepass"))


# --- text -------------------------------------------------------------------------------------------------

TABLES = {
    "reach.trc": first_lines(ROOT / "examples/markers/reach.trc"),
    "cases.trc": (ROOT / "tests/data/opensim/dataWithNaNsOfDifferentCases.trc").read_text(encoding="utf-8"),
    "nexus.csv": NEXUS,
    "plain.csv": "Frame;Time (s);wrist X (mm);wrist Y (mm);wrist Z (mm)\n1;0,5;1,5;2;3\n2;0,6;;;\n",
    "qualisys.tsv": QUALISYS.format(
        columns="Frame\tTime\tLELB X\tLELB Y\tLELB Z\tLWRI X\tLWRI Y\tLWRI Z\n",
        rows="1\t0.00000\t1\t2\t3\t4\t5\t6\n2\t0.01000\t1\t2\t3\t0\t0\t0\n",
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_marker_tables(name, tmp_path):
    def check(harm, unit):
        put(tmp_path / name, wounded(TABLES[name], harm))
        markers = answered(lambda: oarlock.markers.load_markers(tmp_path / name, unit))
        if markers is not None:
            assert markers.position_m.shape == (len(markers.time_s), len(markers.names), 3)
            answered(lambda: markers.save(tmp_path / "again.csv"))

    campaign(check, wounds, st.sampled_from([None, "m", "mm", "inch"]))


def test_csv_with_its_mapping(tmp_path):
    folder = ROOT / "examples/club_csv"
    mapping = (folder / "mapping.toml").read_text(encoding="utf-8")
    trunk, seat = first_lines(folder / "rumpf.csv", encoding="cp1252"), first_lines(folder / "rollsitz.csv")

    def check(which, harm):
        texts = {"mapping.toml": mapping, "rumpf.csv": trunk, "rollsitz.csv": seat}
        texts[which] = wounded(texts[which], harm)
        for name, text in texts.items():
            put(tmp_path / name, text, "cp1252" if name == "rumpf.csv" else "utf-8")
        answered(lambda: read_csv(tmp_path / "mapping.toml"))

    campaign(check, st.sampled_from(["mapping.toml", "rumpf.csv", "rollsitz.csv"]), wounds)


def test_apdm(tmp_path):
    text = first_lines(ROOT / "examples/pendulum/imuData01.csv", 12)
    feed(tmp_path / "units.csv", text, read_apdm, read_apdm_orientations)


MTMANAGER = ROOT / "tests/data/opensim/mtmanager"


@pytest.mark.parametrize(
    "name", ["MT2022_ACC_GYRO_ROT_ALL_TAB_NAN_00B42D4B.txt", "MT46_01-000_00B42D4D.txt", "test1_00B421E6.txt"]
)
def test_mtmanager(name, tmp_path):
    text = (MTMANAGER / name).read_text(encoding="utf-8")
    feed(tmp_path / name, text, partial(read_mtmanager, rate_hz=100.0, orientations=True), read_mtmanager)


@pytest.mark.parametrize("body", [test_io_dot.RATES, test_io_dot.RECORDED])
def test_dot(body, tmp_path):
    text = test_io_dot.HEAD.format(tag="Arm", sync="Synced", mode="Recording") + body
    feed(tmp_path / "Arm_20250711_200600_086.csv", text, partial(read_dot, orientations=True))


@pytest.mark.parametrize("text", [test_io_shimmer.SESSION, test_io_shimmer.TWO])
def test_shimmer(text, tmp_path):
    feed(tmp_path / "session.csv", text, read_shimmer, partial(read_shimmer, accel="WR"))


def test_mvnx(tmp_path):
    feed(tmp_path / "trial.mvnx", test_io_mvnx.TRIAL, read_mvnx)


def test_orientations_of_opensim(tmp_path):
    text = (ROOT / "tests/data/opensim/orientation_quats.sto").read_text(encoding="utf-8")
    feed(tmp_path / "turns.sto", text, read_sto, partial(read_sto, up="y"))


DEVICES = {
    "MT46_01-000_00B42D4D.txt": (MTMANAGER / "MT46_01-000_00B42D4D.txt").read_text(encoding="utf-8"),
    "1_20250711_200600_086.csv": test_io_dot.HEAD.format(tag="1", sync="Synced", mode="") + test_io_dot.RATES,
    "session.csv": test_io_shimmer.SESSION,
    "trial.mvnx": test_io_mvnx.TRIAL,
    "turns.sto": (ROOT / "tests/data/opensim/orientation_quats.sto").read_text(encoding="utf-8"),
}


@pytest.mark.parametrize("name", DEVICES)
def test_finders_of_devices(name, tmp_path):
    def check(harm):
        put(tmp_path / name, wounded(DEVICES[name], harm))
        listing = listed(tmp_path)
        for find in (find_mtmanager, find_dot, find_shimmer, find_mvnx, find_sto):
            assert all(one.files == (tmp_path / name,) and one.name and one.about for one in find(listing))

    campaign(check, wounds)


TOML = {
    "attachments": (ROOT / "examples/markers/arm.toml", oarlock.markers.load_attachments),
    "study": (
        ROOT / "examples/studies/noise_grade.toml",
        lambda file: oarlock.studies.load_study(file, SIMULATORS),
    ),
    **{name: (model_path(name), oarlock.load_model) for name in ("pendulum3", "sculler_ball")},
}


@pytest.mark.parametrize("name", TOML)
def test_toml_files(name, tmp_path):
    source, load = TOML[name]
    feed(tmp_path / "file.toml", source.read_text(encoding="utf-8"), load)


def harm_one(whole, which, harm, text_harm):
    """Puts a folder's files back as they were, but for one, whose bytes or text are wounded."""
    for file, content in whole.items():
        file.write_bytes(content)
    file = sorted(whole)[which % len(whole)]
    if file.suffix == ".parquet":
        file.write_bytes(wounded_bytes(whole[file], harm))
    else:
        put(file, wounded(whole[file].decode("utf-8"), text_harm))


@pytest.mark.parametrize("file_format", ["parquet", "csv"])
def test_recording_folders(file_format, tmp_path):
    example().save(tmp_path, file_format)
    (tmp_path / MANIFEST).unlink()  # else its hashes answer for the readers
    whole = {file: file.read_bytes() for file in tmp_path.iterdir()}

    def check(which, harm, text_harm):
        harm_one(whole, which, harm, text_harm)
        recording = answered(lambda: oarlock.load_recording(tmp_path))
        assert recording is None or recording.duration_s >= 0.0

    campaign(check, st.integers(0, 5), byte_wounds, wounds)


def test_track_folders(tmp_path):
    model = oarlock.load_model("pendulum3")
    time_s = np.arange(60) / 50.0
    up = np.tile([0.1, 9.8, 0.0], (60, 1))
    streams = [
        oarlock.recording.ImuStream(name, time_s, gyro_rad_s=0.0 * up, accel_m_s2=up)
        for name in model.sensor_names
    ]
    oarlock.track(model, oarlock.Recording(streams)).save(tmp_path)
    (tmp_path / MANIFEST).unlink()
    whole = {file: file.read_bytes() for file in tmp_path.iterdir()}

    def check(which, harm, text_harm):
        harm_one(whole, which, harm, text_harm)
        track = answered(lambda: oarlock.load_track(tmp_path))
        if track is not None:
            repr(track)

    campaign(check, st.integers(0, 5), byte_wounds, wounds)


# --- binary -----------------------------------------------------------------------------------------------


def test_c3d(tmp_path):
    c3d_file(tmp_path / "whole.c3d", ["Bob:A", "Bob:B", "*12"])
    feed(
        tmp_path / "trial.c3d", (tmp_path / "whole.c3d").read_bytes(), oarlock.markers.load_markers, count=30
    )


def matlab_files(folder):
    """Small files of each layout that is read."""
    rows = np.random.default_rng(0).normal(size=(30, 17))
    quat = rows[:, :4] / np.linalg.norm(rows[:, :4], axis=1, keepdims=True)
    broad = {"sampling_rate": 286.0, "imu_gyr": rows[:, :3], "imu_acc": rows[:, 3:6], "imu_mag": rows[:, 6:9]}
    savemat(folder / "broad.mat", broad | {"opt_quat": quat, "opt_pos": rows[:, :3], "movement": rows[:, :1]})
    pair = {"rate": 50.0, "sensorData": rows[:, :12], "ref": rows, "r_12": rows[0, :3], "r_21": rows[1, :3]}
    savemat(folder / "pair.mat", {"data": pair}, do_compression=True)
    segment = {"gyr": rows[:, :3], "acc": rows[:, 3:6]}
    savemat(folder / "body.mat", {"t": np.arange(30.0)[:, None] / 60.0, "hip": segment, "chest": segment})


MATLAB = {
    "broad.mat": (read_broad, read_broad_reference),
    "pair.mat": (read_dfjimu, read_dfjimu_reference),
    "body.mat": (read_qmt,),
}


def outcomes(of):
    """The function with its results and refusals kept, so that readers of one file share one child process."""

    @cache
    def outcome(_content, *arguments):
        try:
            return of(*arguments), None
        except oarlock.DataError as refusal:
            return None, refusal

    def shared(kind, file):
        arrays, refusal = outcome(file.read_bytes(), kind, file)
        if refusal:
            raise refusal
        return dict(arrays)

    return shared


@pytest.mark.parametrize(
    "name", ["pair.mat", *(pytest.param(n, marks=pytest.mark.long) for n in ("broad.mat", "body.mat"))]
)
def test_matlab_files(name, tmp_path, monkeypatch):
    monkeypatch.setattr(mat, "arrays_of", outcomes(mat.arrays_of))
    matlab_files(tmp_path)
    feed(tmp_path / "wounded.mat", (tmp_path / name).read_bytes(), *MATLAB[name], count=12)


OWN = ("load_model", "load_recording", "load_calibration", "load_track")
READERS = {name: getattr(oarlock, name) for name in OWN}
READERS |= {name: getattr(oarlock.markers, name) for name in ("load_markers", "load_attachments")}
READERS["load_study"] = oarlock.studies.load_study
READERS |= {
    read.__name__: read for read in (read_csv, read_apdm, read_broad, read_dfjimu, read_qmt, read_mtmanager)
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize(
    "place", ["", "nothing_here", "a folder", "a\x00b", "x" * 300, "empty.toml", "noise"]
)
def test_places_that_hold_nothing(name, place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a folder").mkdir()
    Path("empty.toml").touch()
    Path("noise").write_bytes(os.urandom(200))
    with pytest.raises((oarlock.DataError, oarlock.ModelError)) as refusal:
        READERS[name](place)
    assert len(str(refusal.value)) > 10
