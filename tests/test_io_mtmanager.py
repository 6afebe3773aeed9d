"""Exports of Xsens MT Manager: the files of OpenSim's own tests, read once more by plain splitting."""

import re
from pathlib import Path

import numpy as np
import pytest

from local_data import local_folder
from oarlock.formats.choices import UnclearError
from oarlock.formats.devices.mtmanager import find_mtmanager, read_mtmanager
from oarlock.formats.listing import listed
from oarlock.model.rotation import matrix_from_quat
from oarlock.recording.packets import missing_packets
from oarlock.recording.streams import ImuStream, OrientationStream
from refusals import assert_refused

SAMPLES = Path(__file__).parent / "data/opensim/mtmanager"
WHOLE = "data/opensim_core/OpenSim/Tests/shared/IMUData/Xsens"
PRINTED = 2e-6
"""The files print six digits, so a matrix and a quaternion of one row agree to about two of the last digit."""


def independent(file):
    """Columns by name, by splitting lines: no code of the package."""
    text = file.read_text(encoding="utf-8").splitlines()
    row = next(k for k, line in enumerate(text) if "PacketCounter" in line)
    separator = next(c for c in "\t;, " if c in text[row])
    names = text[row].split(separator)
    cells = [line.split(separator) for line in text[row + 1 :]]
    return {n: np.array([float(c[i] or "nan") for c in cells]) for i, n in enumerate(names)}


def stacked(columns, *names):
    return np.column_stack([columns[name] for name in names])


def vector(columns, kind):
    return stacked(columns, *(f"{kind}_{axis}" for axis in "XYZ"))


def matrices(columns):
    return np.stack(
        [stacked(columns, *(f"Mat[{row}][{column}]" for column in (1, 2, 3))) for row in (1, 2, 3)], axis=1
    )


def edited(tmp_path, old, new, name="MT46_01-000_00B42D4D.txt", count=1):
    text = (SAMPLES / name).read_text(encoding="utf-8")
    assert old in text
    (tmp_path / name).write_bytes(text.replace(old, new, count).encode("utf-8"))
    return tmp_path / name


def refused(file, *words, **options):
    assert_refused(lambda: read_mtmanager(file, **options), *words)


def test_folder_of_several_trials():
    found = {one.name: one for one in find_mtmanager(listed(SAMPLES))}
    assert len(found) == 11 and sum(len(one.files) for one in found.values()) == 13
    trial = found["MT46_01-000"]
    assert trial.path == SAMPLES and trial.options == {"trial": "MT46_01-000"}
    assert [file.name[-12:-4] for file in trial.files] == ["00B42D4D", "00B42D4E"]
    alone = found["test1"]
    assert alone.path == alone.files[0] and alone.options == {}
    assert alone.about == "Xsens MT Manager, 1 unit"
    assert "--rate-hz" in found["MT2022_ACC"].about
    refused(SAMPLES, "has 11 trials", "--trial", "MT46_01-000")
    refused(SAMPLES, 'There is no "MT47"', trial="MT47")


@pytest.mark.parametrize("file", sorted(SAMPLES.glob("*.txt")), ids=lambda file: file.stem)
def test_every_sample_to_the_last_bit(file):
    recording = read_mtmanager(file, rate_hz=100.0, orientations=True)
    columns = independent(file)
    name = file.stem[-8:].lower()
    stream = recording[name]
    assert (
        stream.time_s.tolist() == ((columns["PacketCounter"] - columns["PacketCounter"][0]) / 100.0).tolist()
    )
    np.testing.assert_array_equal(stream.accel_m_s2, vector(columns, "Acc"))
    if "Gyr_X" in columns:
        np.testing.assert_array_equal(stream.gyro_rad_s, vector(columns, "Gyr"))
    if "Mag_X" in columns:
        factor = recording.meta["mag_scale"][name]
        np.testing.assert_array_equal(stream.mag_ut, vector(columns, "Mag") * factor)
    if "Quat_q0" in columns:
        quat = recording[f"{name}_orientation"].quat_wxyz
        np.testing.assert_array_equal(quat, stacked(columns, *(f"Quat_q{k}" for k in range(4))))
    elif "Mat[1][1]" in columns:
        turned = matrix_from_quat(recording[f"{name}_orientation"].quat_wxyz)
        np.testing.assert_allclose(turned, matrices(columns), atol=PRINTED)


def test_one_row_in_three_forms_is_one_orientation(tmp_path):
    """A quaternion, a matrix and three angles of the same rows: so axes and sequence of each are known."""
    file = SAMPLES / "MT2022_ACC_GYRO_ROT_ALL_TAB_NAN_00B42D4B.txt"
    text = file.read_text(encoding="utf-8")
    by_quat = read_mtmanager(file, rate_hz=100.0, orientations=True)["00b42d4b_orientation"].quat_wxyz
    for form, hidden in (("Mat", ("Quat",)), ("Roll", ("Quat", "Mat"))):
        shown = re.sub("|".join(hidden), "Other", text)
        (tmp_path / "form_00B42D4B.txt").write_text(shown, encoding="utf-8")
        recording = read_mtmanager(tmp_path / "form_00B42D4B.txt", rate_hz=100.0, orientations=True)
        quat = recording["00b42d4b_orientation"].quat_wxyz
        sign = np.sign((quat * by_quat).sum(axis=1, keepdims=True))
        np.testing.assert_allclose(sign * quat, by_quat, atol=PRINTED, err_msg=form)


def test_orientation_takes_the_sensor_to_the_earth():
    recording = read_mtmanager(SAMPLES, trial="MT46_01-000", orientations=True)
    for name in ("00b42d4d", "00b42d4e"):
        up = (
            matrix_from_quat(recording[f"{name}_orientation"].quat_wxyz)
            @ recording[name].accel_m_s2[..., None]
        )
        # At rest; 0.3 m/s2 covers the accelerometer's bias and a tilt of a degree.
        np.testing.assert_allclose(up[..., 0], np.tile([0.0, 0.0, 9.81], (5, 1)), atol=0.3)


def test_what_a_recording_says():
    recording = read_mtmanager(SAMPLES, trial="MT_012005D6_031-000")
    assert recording.names == ("00b421af", "00b4227b")
    source = recording.meta["source"]
    assert source["files"] == ["MT_012005D6_031-000_00B421AF.txt", "MT_012005D6_031-000_00B4227B.txt"]
    assert source["units"]["00b421af"] == {"firmware": "4.0.2", "filter": "human (46.1)", "rate_hz": 100.0}
    assert "UTC_Nano" in source["left_out"] and "Acc_X" not in source["left_out"]
    assert recording.meta["clock"] == {"kind": "samples", "from": "PacketCounter"}
    assert "arbitrary units" in source["notes"][0]
    norms = np.linalg.norm(recording["00b421af"].mag_ut, axis=1)
    assert np.median(norms) == pytest.approx(50.0)


def test_without_a_gyroscope_the_orientation_is_a_stream():
    recording = read_mtmanager(SAMPLES / "MT_01200312-002-000_00B474BA.txt", rate_hz=60.0)
    assert recording.names == ("00b474ba", "00b474ba_orientation")
    assert isinstance(recording["00b474ba_orientation"], OrientationStream)
    assert recording["00b474ba"].gyro_rad_s is None
    assert recording["00b474ba"].time_s[1] == 1.0 / 60.0


def test_wrapping_counter_and_lost_packets(tmp_path):
    file = edited(tmp_path, "\n04097\t", "\n65533\t")
    text = file.read_text(encoding="utf-8")
    for old, new in (("04098", "65534"), ("04099", "00001"), ("04100", "00002"), ("04101", "00003")):
        text = text.replace(f"\n{old}\t", f"\n{new}\t")
    file.write_text(text, encoding="utf-8")
    later = edited(tmp_path, "\n04097\t", "\n00000\t", "MT46_01-000_00B42D4E.txt")
    text = later.read_text(encoding="utf-8")
    for k in range(4098, 4102):
        text = text.replace(f"\n0{k}\t", f"\n0000{k - 4097}\t")
    later.write_text(text, encoding="utf-8")
    recording = read_mtmanager(tmp_path)
    assert recording["00b42d4d"].time_s.tolist() == [0.0, 0.01, 0.04, 0.05, 0.06]
    assert recording["00b42d4e"].time_s.tolist() == [0.03, 0.04, 0.05, 0.06, 0.07]
    assert missing_packets(recording, recording["00b42d4d"]) == 2
    assert recording.meta["packets"]["00b42d4d"]["after_s"] == [0.01]


def test_a_packet_that_stands_twice_is_read_once(tmp_path):
    name = "MT46_01-000_00B42D4D.txt"
    lines = (SAMPLES / name).read_text(encoding="utf-8").splitlines()
    row = next(k for k, line in enumerate(lines) if "PacketCounter" in line) + 1
    (tmp_path / name).write_text("\n".join([*lines[: row + 1], *lines[row:]]), encoding="utf-8")
    recording, plain = read_mtmanager(tmp_path / name), read_mtmanager(SAMPLES / name)
    assert len(recording.streams[0].time_s) == len(plain.streams[0].time_s)
    np.testing.assert_array_equal(recording.streams[0].gyro_rad_s, plain.streams[0].gyro_rad_s)
    assert "twice: 1" in str(recording.meta)
    changed = lines[row].replace(lines[row].split()[1], "1.0", 1)
    (tmp_path / name).write_text("\n".join([*lines[: row + 1], changed, *lines[row + 1 :]]), encoding="utf-8")
    refused(tmp_path / name, "duplicated or out of order")


def test_sample_time_fine_gives_the_stamps(tmp_path):
    file = edited(tmp_path, "", "")
    text = file.read_text(encoding="utf-8")
    for k, ticks in enumerate((4294967196, 4294967295, 100, 200, 299)):
        text = text.replace(f"\n0{4097 + k}\t\t", f"\n0{4097 + k}\t{ticks}\t")
    file.write_text(text, encoding="utf-8")
    recording = read_mtmanager(file)
    assert recording["00b42d4d"].time_s.tolist() == [
        t / 1e4 for t in (4294967196, 4294967295, 2**32 + 100, 2**32 + 200, 2**32 + 299)
    ]
    assert recording.meta["clock"]["from"] == "SampleTimeFine"
    (tmp_path / "MT46_01-000_00B42D4E.txt").write_bytes((SAMPLES / "MT46_01-000_00B42D4E.txt").read_bytes())
    refused(tmp_path, "00B42D4E.txt", "SampleTimeFine is empty", "no common clock")


@pytest.mark.parametrize(
    ("encoding", "end"), [("utf-8-sig", "\n"), ("utf-8", "\r\n"), ("utf-16", "\r\n"), ("latin-1", "\n")]
)
def test_encodings_and_line_ends(tmp_path, encoding, end):
    name = "MT46_01-000_00B42D4D.txt"
    text = "// Comment: Größe\n" + (SAMPLES / name).read_text(encoding="utf-8")
    (tmp_path / name).write_bytes(text.replace("\n", end).encode(encoding))
    plain = read_mtmanager(SAMPLES / name)["00b42d4d"]
    np.testing.assert_array_equal(read_mtmanager(tmp_path / name)["00b42d4d"].gyro_rad_s, plain.gyro_rad_s)


def test_decimal_commas(tmp_path):
    name = "MT2022_ACC_GYRO_ROT_MAT_SEMICOLON_00B42D4B.txt"
    head, rows = (SAMPLES / name).read_text(encoding="utf-8").split("PacketCounter")
    (tmp_path / name).write_text(f"{head}PacketCounter{rows.replace('.', ',')}", encoding="utf-8")
    plain = read_mtmanager(SAMPLES / name, rate_hz=100.0)["00b42d4b"]
    again = read_mtmanager(tmp_path / name, rate_hz=100.0)["00b42d4b"]
    np.testing.assert_array_equal(again.accel_m_s2, plain.accel_m_s2)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.128211", "0.12x", [":6", '"Acc_Y"', "0.12x"]),
        ("\n04098", "\n04097", [":7", '"PacketCounter"', "4097 after 4097", "duplicated"]),
        ("\n04098", "\n", [":7", '"PacketCounter"', "counter is missing"]),
        ("\n04098", "\n99999", [":7", '"PacketCounter"', "is 99999; expected 0 to 65535"]),
        ("\t-0.484709\n", "\n", [":6", "15 fields", "16"]),
        ("0.414280", "0.914280", [":6", '"Quat_q0"', "norm"]),
        ("Gyr_Y", "Gyr_U", ['"Gyr_X"', 'none "Gyr_Y"']),
        ("Update Rate: 100.0Hz", "Update Rate: unknown", ["time is not known", "--rate-hz"]),
        ("PacketCounter", "Counter", ["not an export of MT Manager", "PacketCounter"]),
        ("// Start", "Start", ["not an export of MT Manager"]),
    ],
)
def test_mistakes(tmp_path, old, new, words):
    refused(edited(tmp_path, old, new), "00B42D4D.txt", *words)


def test_a_rate_that_is_not_stated_can_be_answered():
    with pytest.raises(UnclearError, match="oarlock import mtmanager PATH --rate-hz") as unclear:
        read_mtmanager(SAMPLES / "MT2022_ACC_00B42D4B.txt")
    assert unclear.value.option == "rate_hz" and not unclear.value.choices


def test_rates_that_contradict(tmp_path):
    refused(SAMPLES / "MT46_01-000_00B42D4D.txt", "Update Rate is 100 Hz", "60 Hz", rate_hz=60.0)
    edited(tmp_path, "100.0Hz", "60.0Hz")
    edited(tmp_path, "", "", "MT46_01-000_00B42D4E.txt")
    refused(tmp_path, "different rates (60, 100 Hz)")


def test_matrix_that_is_no_rotation(tmp_path):
    name = "test1_00B421E6.txt"
    refused(edited(tmp_path, "-0.482056", "0.982056", name), ":7", "no rotation", orientations=True)


def test_axes_that_do_not_point_up_are_left_out(tmp_path):
    name = "MT_01200454_000-000_00B40DE4.txt"
    recording = read_mtmanager(edited(tmp_path, "ENU", "NED", name), rate_hz=100.0, orientations=True)
    assert recording.names == ("00b40de4",)
    assert any("NED" in note for note in recording.meta["source"]["notes"])


def test_files_without_readings(tmp_path):
    head = (SAMPLES / "MT2022_ACC_00B42D4B.txt").read_text(encoding="utf-8")
    (tmp_path / "cut_00B42D4B.txt").write_text(head[: head.index("51400")], encoding="utf-8")
    refused(tmp_path / "cut_00B42D4B.txt", "no rows of data")
    (tmp_path / "other_00B42D4B.txt").write_text(head.replace("Acc", "Vel"), encoding="utf-8")
    refused(tmp_path / "other_00B42D4B.txt", ":13", "calibrated inertial data")
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", "has no exports of MT Manager")


@pytest.mark.data
def test_whole_recording_to_the_last_bit():
    folder = local_folder(WHOLE)
    recording = read_mtmanager(folder, trial="MT_012005D6_031-000", orientations=True)
    for name in ("00b421af", "00b4227b"):
        columns = independent(folder / f"MT_012005D6_031-000_{name.upper()}.txt")
        stream, own = recording[name], recording[f"{name}_orientation"]
        assert isinstance(stream, ImuStream) and len(stream) == 3369
        np.testing.assert_array_equal(stream.gyro_rad_s, vector(columns, "Gyr"))
        np.testing.assert_array_equal(stream.accel_m_s2, vector(columns, "Acc"))
        np.testing.assert_allclose(matrix_from_quat(own.quat_wxyz), matrices(columns), atol=PRINTED)


@pytest.mark.data
def test_lost_packets_of_a_real_recording():
    file = local_folder(WHOLE) / "MT_012005D6-000_sit_to_stand-000_00B421ED.txt"
    recording = read_mtmanager(file)
    (stream,) = recording
    steps = np.diff(independent(file)["PacketCounter"])
    assert missing_packets(recording, stream) == int((steps - 1).sum()) == 68
    assert len(recording.meta["packets"]["00b421ed"]["after_s"]) == 64
    assert stream.time_s[-1] == (36692 - 35166) / 40.0
