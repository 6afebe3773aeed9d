"""Importers of the public data sets, on small files made here; the real ones are read in test_io_validation_data.py."""

import json

import numpy as np
import pytest
from scipy.io import savemat

from command_line import run
from oarlock import load_recording
from oarlock.evaluation.reference import Reference
from oarlock.formats.datasets.broad import read_broad, read_broad_reference
from oarlock.formats.datasets.dfjimu import read_dfjimu, read_dfjimu_reference
from oarlock.formats.datasets.diodem import SEGMENTS, read_diodem, read_diodem_reference
from oarlock.formats.datasets.openaxes import (
    LINK_FROM_SENSOR,
    openaxes_runs,
    read_openaxes,
    read_openaxes_reference,
)
from oarlock.formats.datasets.qmt import read_qmt
from oarlock.storage.errors import DataError
from refusals import assert_refused

ROWS = 6
TURNED = [0.6, 0.0, 0.8, 0.0]


def counted(columns, rows=ROWS):
    """A matrix in which every number tells its row and column."""
    return np.arange(rows)[:, None] + np.arange(columns) / 100.0


QMT_SEGMENT = {"acc": counted(3), "gyr": counted(3) + 5.0, "quat": counted(4)}


def dfjimu_file(folder, **changes):
    quats = np.tile([1.0, 0.0, 0.0, 0.0, *TURNED], (ROWS, 1))
    data = {
        "rate": np.uint8(50),
        "r_12": [0.1, 0.0, -0.02],
        "r_21": [-0.2, 0.01, 0.0],
        "sensorData": counted(12),
        "ref": np.hstack([quats, counted(9)]),
        "obsMeas": np.zeros((ROWS, 1)),
    } | changes
    savemat(folder / "data.mat", {"data": {k: v for k, v in data.items() if v is not None}})
    return folder / "data.mat"


def test_dfjimu(tmp_path):
    recording = read_dfjimu(dfjimu_file(tmp_path))
    assert recording.names == ("body1", "body2")
    second = recording["body2"]
    assert second.rate_hz == pytest.approx(50.0)
    assert second.time_s[:2].tolist() == pytest.approx([-0.01, 0.01])  # middles of the intervals
    assert second.accel_m_s2[3].tolist() == [3.06, 3.07, 3.08]
    assert second.gyro_rad_s[3].tolist() == [3.09, 3.1, 3.11]
    assert second.mag_ut is None
    assert recording.meta["joint_in_sensor_m"]["body1"] == [0.1, 0.0, -0.02]
    reference = read_dfjimu_reference(tmp_path / "data.mat")
    assert reference.bodies == ("body1", "body2")
    assert reference.quat_wxyz["body2"][0].tolist() == pytest.approx(TURNED)
    assert reference.scored.all() and reference.scored.shape == (ROWS,)
    assert reference.time_s[:2].tolist() == pytest.approx([0.0, 0.02])
    # The joint is saved with the recording.
    recording.save(tmp_path / "rec")
    assert load_recording(tmp_path / "rec").meta["joint_in_sensor_m"]["body2"] == [-0.2, 0.01, 0.0]


def test_mistakes_in_the_reference_of_dfjimu(tmp_path):
    with pytest.raises(DataError, match=r"5 rows, but data\.sensorData has 6"):
        read_dfjimu_reference(dfjimu_file(tmp_path, ref=np.ones((5, 17))))
    with pytest.raises(DataError, match=r"norm 2\.0000"):
        read_dfjimu_reference(dfjimu_file(tmp_path, ref=np.ones((ROWS, 17))))


def test_a_file_that_is_absent_and_one_without_a_structure(tmp_path):
    assert_refused(lambda: read_broad(tmp_path / "absent.mat"), "cannot be read")
    savemat(tmp_path / "plain.mat", {"data": np.ones((2, 2))})
    assert_refused(lambda: read_dfjimu(tmp_path / "plain.mat"), "is not a structure")


def broad_file(folder, **changes):
    quats = np.tile(TURNED, (ROWS, 1))
    quats[2] = np.nan
    variables = {
        "imu_gyr": counted(3),
        "imu_acc": counted(3) + 10.0,
        "imu_mag": counted(3) + 20.0,
        "opt_quat": quats,
        "opt_pos": counted(3) + 30.0,
        "movement": np.array([0, 0, 1, 1, 1, 0], dtype=np.uint8)[:, None],
        "sampling_rate": 2000.0 / 7.0,
    } | changes
    savemat(folder / "trial.mat", {k: v for k, v in variables.items() if v is not None})
    return folder / "trial.mat"


def test_broad(tmp_path):
    file = broad_file(tmp_path)
    stream = read_broad(file)["imu"]
    assert stream.rate_hz == pytest.approx(285.714, abs=1e-3)
    assert stream.time_s[:2].tolist() == pytest.approx([-0.00175, 0.00175])  # middles of the intervals
    assert stream.mag_ut[4].tolist() == pytest.approx([24.0, 24.01, 24.02])
    reference = read_broad_reference(file)
    assert reference.scored.tolist() == [False, False, True, True, True, False]
    assert reference.there("imu").tolist() == [True, True, False, True, True, True]
    assert reference.position_m["imu"][5].tolist() == pytest.approx([35.0, 35.01, 35.02])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rate": None}, ['no variable "data.rate"']),
        ({"rate": 0.0}, ["data.rate", "0 Hz"]),
        ({"sensorData": counted(11)}, ["data.sensorData", "(6, 11)", "(T, 12)"]),
        ({"sensorData": np.full((ROWS, 12), np.inf)}, ['"body1"', "inf"]),
        ({"r_12": [0.1, 0.2]}, ["data.r_12", "(1, 2)"]),
        ({"imu_mag": None}, ['no variable "imu_mag"']),
        ({"imu_acc": counted(3, rows=5)}, ['"imu", accel_m_s2', "5 rows", "6"]),
        ({"sampling_rate": -1.0}, ["sampling_rate", "-1 Hz"]),
        ({"imu_gyr": np.full((ROWS, 3), 1j)}, ["imu_gyr", "not real"]),
    ],
)
def test_mistakes_in_dfjimu_and_broad(tmp_path, changes, words):
    broad = {"imu_mag", "imu_acc", "sampling_rate", "imu_gyr"} & set(changes)
    read, written = (read_broad, broad_file) if broad else (read_dfjimu, dfjimu_file)
    assert_refused(lambda: read(written(tmp_path, **changes)), *words)


def qmt_file(folder):
    time_s = 40.0 + np.arange(ROWS)[:, None] / 100
    savemat(folder / "body.mat", {"t": time_s, "hip": QMT_SEGMENT, "hand_left": QMT_SEGMENT})
    return folder / "body.mat"


def test_qmt(tmp_path):
    recording = read_qmt(qmt_file(tmp_path))
    assert recording.names == ("hip", "hand_left")
    assert recording.start_s == 40.0
    assert recording["hip"].gyro_rad_s[1].tolist() == [6.0, 6.01, 6.02]
    savemat(tmp_path / "short.mat", {"t": np.arange(3.0)[:, None], "hip": QMT_SEGMENT})
    assert_refused(lambda: read_qmt(tmp_path / "short.mat"), "t has 3 rows, but hip.gyr has 6")
    savemat(tmp_path / "alone.mat", {"t": np.arange(3.0)[:, None]})
    assert_refused(lambda: read_qmt(tmp_path / "alone.mat"), "no segment")


def csv(file, head, columns, rows):
    file.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join("" if np.isnan(x) else repr(float(x)) for x in row) for row in rows]
    file.write_text("\n".join([*head, ",".join(columns), *lines]) + "\n")


def diodem_folder(folder):
    head = ["# sampling frequency: {}", "# units are seconds/meters/radians/a.u."]
    imu = [f"{s}_{q}_{a}" for s in SEGMENTS for q in ("acc", "gyr", "mag") for a in "xyz"]
    for name, shift in (("imu_rigid", 0.0), ("imu_nonrigid", 100.0)):
        csv(folder / f"{name}.csv", [line.format(40) for line in head], imu, counted(45) + shift)
    marks = [f"{s}_marker{m}_{a}" for s in SEGMENTS for m in (1, 2, 3, 4) for a in "xyz"]
    quats = [f"{s}_quat_{a}" for s in SEGMENTS for a in "wxyz"]
    rows = np.hstack([counted(60), np.tile(TURNED, (ROWS, 5))])
    rows[1, 0] = np.nan
    rows[2, 61] = np.nan
    csv(folder / "omc.csv", [line.format(30) for line in head], [*marks, *quats], rows)
    return folder


def test_diodem(tmp_path):
    folder = diodem_folder(tmp_path)
    recording = read_diodem(folder)
    assert recording.names == SEGMENTS
    assert recording["seg2"].time_s[1] == pytest.approx(1 / 40)
    assert recording["seg2"].accel_m_s2[0].tolist() == [0.09, 0.10, 0.11]
    assert recording["seg2"].gyro_rad_s[0].tolist() == [0.12, 0.13, 0.14]
    assert recording["seg2"].mag_ut is None
    foam = read_diodem(folder, "foam", mag_unit_ut=50.0)
    assert foam["seg1"].mag_ut[0].tolist() == pytest.approx([5003.0, 5003.5, 5004.0])
    assert foam.meta["mounted"] == "foam"
    reference = read_diodem_reference(folder)
    assert reference.rate_hz == pytest.approx(30.0)
    # a marker or a component that is missing takes the whole row with it
    assert reference.there("seg1").tolist() == [True, True, False, True, True, True]
    assert np.isnan(reference.position_m["seg1"][1, 0])
    assert reference.position_m["seg1"][0].tolist() == pytest.approx([0.045, 0.055, 0.065])


def test_mistakes_in_diodem(tmp_path):
    folder = diodem_folder(tmp_path)
    assert_refused(lambda: read_diodem(folder, "loose"), 'mounted = "loose"')
    file = folder / "imu_rigid.csv"
    text = file.read_text(encoding="utf-8")
    for old, new, words in (
        ("# sampling frequency: 40", "# rate 40", r"imu_rigid\.csv:1: .*does not state the rate"),
        ("# sampling frequency: 40", "# sampling frequency: 0", "does not state the rate"),
        ("seg3_gyr_y", "seg3_gyro_y", 'has no column "seg3_gyr_y"'),
        ("0.09,", "left,", '"left" is not a number'),
    ):
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(DataError, match=words):
            read_diodem(folder)
    assert_refused(lambda: read_diodem(tmp_path / "absent"), "cannot be read")


def openaxes_folder(folder, rows=ROWS):
    for link in ("radius", "carpus"):
        readings = [f"{q}_{a}" for q in ("acc", "gyr") for a in "xyz"]
        csv(folder / f"synced_imu/circle-100/{link}_adx.csv", [], ["", *readings], counted(7))
        stamps = 1_000_000.0 + 8000.0 * np.arange(rows)
        quats = np.hstack([stamps[:, None], np.tile(TURNED, (rows, 1))])
        names = ["TIME", *(f"QUATERNION_{i}" for i in range(4))]
        csv(folder / f"groundtruth/robot-circle-100/{link}.csv", [], names, quats)
    return folder


def test_openaxes(tmp_path):
    folder = openaxes_folder(tmp_path)
    assert openaxes_runs(folder) == ("circle-100",)
    recording = read_openaxes(folder, "circle-100")
    assert recording.names == ("radius", "carpus")
    assert recording["carpus"].time_s.tolist() == pytest.approx([0.008 * i for i in range(ROWS)])
    assert recording["carpus"].accel_m_s2[2].tolist() == [2.01, 2.02, 2.03]
    reference = read_openaxes_reference(folder, "circle-100")
    assert reference.source == "encoders"
    assert reference.quat_wxyz["radius"][0].tolist() == pytest.approx(TURNED)
    np.testing.assert_array_equal(np.array(LINK_FROM_SENSOR) @ np.array(LINK_FROM_SENSOR).T, np.eye(3))
    assert np.linalg.det(LINK_FROM_SENSOR) == 1.0


def test_mistakes_in_openaxes(tmp_path):
    assert_refused(lambda: openaxes_runs(tmp_path), "contains no run")
    with pytest.raises(DataError, match=r'no run "spiral".*circle-100'):
        read_openaxes(openaxes_folder(tmp_path), "spiral")
    with pytest.raises(DataError, match=r"6 rows, but its clock .* has 5"):
        read_openaxes(openaxes_folder(tmp_path, rows=5), "circle-100")


def test_a_reference_checks_what_it_is_given():
    time_s = np.arange(3.0)
    quats = np.tile(TURNED, (3, 1))
    near = Reference("optical", time_s, {"a": quats * 1.005})
    assert near.quat_wxyz["a"][0].tolist() == pytest.approx(TURNED)
    for changed, words in (
        ({"quat_wxyz": {}}, "no body"),
        ({"quat_wxyz": {"a": quats[:2]}}, "2 rows"),
        ({"quat_wxyz": {"a": quats * 1.1}}, r"norm 1\.1000"),
        ({"quat_wxyz": {"a": quats * 1e200}}, "norm inf"),
        ({"quat_wxyz": {"a": np.where([[True, True, True, False]] * 3, quats, np.nan)}}, "lacks part"),
        ({"time_s": [0.0, 1.0, 1.0]}, "repeats"),
        ({"scored": np.ones(2, dtype=bool)}, "scored"),
        ({"position_m": {"a": np.ones((3, 2))}}, "position"),
    ):
        with pytest.raises(DataError, match=words):
            Reference(**({"source": "optical", "time_s": time_s, "quat_wxyz": {"a": quats}} | changed))


def test_the_command_line_imports_each(tmp_path):
    (tmp_path / "d").mkdir()
    commands = {
        "dfjimu": [str(dfjimu_file(tmp_path))],
        "broad": [str(broad_file(tmp_path))],
        "diodem": [str(diodem_folder(tmp_path / "d")), "--mounted", "foam", "--mag-unit-ut", "49"],
        "openaxes": [str(openaxes_folder(tmp_path / "o")), "--run", "circle-100"],
        "qmt": [str(qmt_file(tmp_path))],
    }
    for verb, arguments in commands.items():
        done = run("import", verb, *arguments, "--out", str(tmp_path / verb), "--json")
        assert len(json.loads(done.stdout)["streams"]) == len(load_recording(tmp_path / verb))
    assert load_recording(tmp_path / "diodem")["seg1"].mag_ut is not None
    run("import", "diodem", str(tmp_path / "d"), "--mounted", "loose", "--out", str(tmp_path / "x"), status=1)
