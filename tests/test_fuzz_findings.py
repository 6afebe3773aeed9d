"""What fuzzing found in readers and settings, each kept as a test of its own."""

import struct
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import csc_array

import oarlock
from oarlock.formats import child_process
from oarlock.formats.contents import find_recordings
from oarlock.formats.datasets.broad import read_broad
from oarlock.formats.datasets.mat import read_mat
from oarlock.formats.devices.apdm import read_apdm
from oarlock.recording.packets import lost_packets
from oarlock.recording.plausibility import plausibility
from oarlock.rowing import SIMULATORS
from oarlock.storage.errors import DataError
from oarlock.storage.names import numbered
from refusals import assert_refused
from test_markers_io import NEXUS, c3d_file

STUDIES = Path(__file__).parents[1] / "examples/studies"


@pytest.mark.parametrize("field", ["parameters", "mounts", "mag_offsets_ut"])
@pytest.mark.parametrize("given", ["0", 3, [("a", 1.0)]])
def test_a_calibration_of_something_else_than_names_and_values(field, given):
    with pytest.raises(DataError, match=f"calibration, {field}"):
        oarlock.Calibration(**{field: given})


def test_a_nexus_export_whose_section_begins_behind_a_tab(tmp_path):
    file = tmp_path / "nexus.csv"
    file.write_text(NEXUS.replace("Trajectories", "\tTrajectories", 1), encoding="utf-8")
    assert_refused(lambda: oarlock.markers.load_markers(file), 'begins with "Trajectories"')


def test_an_apdm_export_whose_first_line_is_empty(tmp_path):
    file = tmp_path / "units.csv"
    file.write_text("\nTime,x\n", encoding="utf-8")
    assert_refused(lambda: read_apdm(file), "units.csv:1: is empty")


@pytest.mark.parametrize("content", [b"", b"time,acc\n1,2\n", b"\x00" * 4, b" " * 126, b"M" * 130])
def test_a_matlab_file_that_is_none(tmp_path, content):
    file = tmp_path / "trial.mat"
    file.write_bytes(content)
    assert_refused(lambda: read_broad(file), "MATLAB")


def matlab_file(folder, compressed=False, **variables):
    file = folder / "trial.mat"
    savemat(file, variables, do_compression=compressed)
    return file


ROWS = np.arange(12.0).reshape(4, 3)
TWO = np.array([ROWS, ROWS[:2]], object)
ENDED = r"is not a MATLAB file, or is damaged \(.+\)"


@pytest.mark.parametrize(
    ("variables", "mark", "further", "written", "said"),
    [
        # scipy ends the process on types that there are not, of rows, fields, cells and texts.
        *(
            ({"imu_gyr": inside}, struct.pack("<II", 9, ROWS.nbytes), 0, bytes([kind]), ENDED)
            for kind in (0, 14, 255)
            for inside in (ROWS, {"field": ROWS}, TWO)
        ),
        ({"note": "eight oars"}, b"eight oars", -8, bytes([250]), ENDED),
        # A text without dimensions.
        (
            {"note": "eight oars"},
            struct.pack("<II", 5, 8),
            4,
            bytes([0]),
            r"damaged \(Error in SDE format data\)",
        ),
        # The second part of a matrix that becomes complex would be read from the tag of the next variable.
        ({"imu_gyr": ROWS, "imu_acc": ROWS}, struct.pack("<II", 6, 8), 9, bytes([8]), ENDED),
        # More cells than bytes.
        (
            {"many": TWO},
            struct.pack("<4I", 5, 8, 1, 2),
            8,
            struct.pack("<II", 1 << 30, 1 << 30),
            r"damaged \(array is too big",
        ),
        # A version that scipy does not read.
        (
            {"imu_gyr": ROWS},
            struct.pack("<H", 0x0100),
            0,
            struct.pack("<H", 0x0200),
            r"7\.3: save .* MATLAB with -v7",
        ),
    ],
)
def test_a_matlab_file_with_a_wrong_byte(tmp_path, variables, mark, further, written, said):
    file = matlab_file(tmp_path, **variables)
    changed(file, file.read_bytes().index(mark) + further, written)
    with pytest.raises(DataError, match=rf"trial\.mat: .*{said}"):
        read_mat(file)


@pytest.mark.parametrize("compressed", [False, True])
def test_a_matlab_file_that_was_cut_off(tmp_path, compressed):
    file = matlab_file(tmp_path, compressed, imu_gyr=ROWS)
    file.write_bytes(file.read_bytes()[:-8])
    with pytest.raises(DataError, match=r"trial\.mat: .* damaged \(could not read bytes\)"):
        read_mat(file)


@pytest.mark.parametrize("compressed", [False, True])
def test_a_whole_matlab_file_of_all_kinds(tmp_path, compressed):
    given = {
        "text": "oar",
        "number": 3,
        "flag": True,
        "turns": ROWS + 1j,
        "deep": {"a": {"b": ROWS}},
        "none": [],
    }
    file = matlab_file(
        tmp_path, compressed, **given, sparse=csc_array(ROWS), cells=np.array([ROWS, "x"], object)
    )
    found, expected = read_mat(file), loadmat(file, struct_as_record=False)
    assert list(found) == ["text", "number", "flag", "turns", "deep.a.b", "none"]
    for name in ("text", "number", "flag", "turns", "none"):
        np.testing.assert_array_equal(found[name], expected[name])
        assert found[name].dtype == expected[name].dtype
    np.testing.assert_array_equal(found["deep.a.b"], ROWS)


@pytest.mark.parametrize("seeds", [0, 10**9, 10**20])
def test_a_study_of_more_seeds_than_anybody_waits_for(tmp_path, seeds):
    file = tmp_path / "study.toml"
    file.write_text(f'format = 1\nmodel = "sculler"\nsimulator = "none"\nseeds = {seeds}\n', encoding="utf-8")
    with pytest.raises(DataError):
        oarlock.studies.load_study(file)


def test_matrices_whose_products_overflow_are_refused():
    huge = np.full((3, 3), 1e308)
    with pytest.raises(DataError, match='mount of "back": rows are not orthonormal'):
        oarlock.Calibration(mounts={"back": (huge, [0.0, 0.0, 0.0])})
    with pytest.raises(DataError, match='mag_matrices of "back": has determinant inf'):
        oarlock.Calibration(mag_matrices={"back": np.diag([1e308, 1e308, 1.0])})


def test_a_plans_step_from_the_first_second_on_survives_its_file(tmp_path):
    steps = [oarlock.calibration.SessionStep("rest", "still", start_s=0.0, end_s=5.0)]
    plan = oarlock.calibration.SessionPlan("short", tuple(steps))
    plan.save(tmp_path / "plan.toml")
    assert oarlock.calibration.load_session_plan(tmp_path / "plan.toml") == plan


def test_readings_that_overflow_are_nobodys_warning():
    time_s, huge = np.arange(5) * 0.01, np.full((5, 3), 1e308)
    assert np.isinf(oarlock.recording.EncoderScale(0.0, 1e200).value(np.full(3, 1e200))).all()
    huge[::2] *= -1.0
    recording = oarlock.Recording(
        [oarlock.recording.ImuStream("back", time_s, gyro_rad_s=huge, accel_m_s2=huge)]
    )
    assert [f.severity for f in plausibility(recording) if "reaches inf rad/s" in f.message] == ["error"]


def test_packets_that_are_no_number_are_refused():
    stream = oarlock.recording.ScalarStream("seat", [0.0, 0.1, 0.2], [0.0, 0.0, 0.0])
    counted = {"after_s": [0.1], "packets": [-np.inf], "step_s": [0.1]}
    with pytest.raises(DataError, match="contains a value that is not a number"):
        lost_packets(oarlock.Recording([stream], {"packets": {"seat": counted}}), stream)


def damaged(file, old, new):
    data = file.read_bytes()
    assert old in data and len(old) == len(new)
    file.write_bytes(data.replace(old, new))


def swung(tmp_path):
    """A recording's folder and a track's."""
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 2.0, 201)
    angles = 0.5 * np.sin(np.outer(time_s, [2.0, 3.0, 4.0]))
    motion = oarlock.simulation.Motion(tuple(model.joint_names), time_s, angles)
    recording = oarlock.simulate(model, motion, seed=1)[1]
    oarlock.track(model, recording).save(tmp_path / "track")
    recording.save(tmp_path / "recording")
    return tmp_path / "recording", tmp_path / "track"


def test_names_of_columns_that_are_no_text_are_refused(tmp_path):
    recording, track = swung(tmp_path)
    damaged(recording / "upper.parquet", b"gyro_x_rad_s", b"gyro_x\xf5rad_s")
    assert_refused(lambda: oarlock.load_recording(recording), "upper.parquet: cannot be read as Parquet")
    damaged(track / "sensors.parquet", b"middle.rejected", b"middle.reject\xf5d")
    with pytest.raises(DataError, match=r"sensors\.parquet: cannot be read.*track the recording again"):
        oarlock.load_track(track)


def test_tables_of_a_track_that_lack_a_column_are_refused(tmp_path):
    _, track = swung(tmp_path)
    damaged(track / "sensors.parquet", b"middle.rejected", b"muddle.rejected")
    with pytest.raises(DataError, match=r"sensors\.parquet: column .*middle\.rejected.* is missing"):
        oarlock.load_track(track)


def test_a_note_that_is_a_type_is_refused_when_it_is_written(tmp_path):
    noted = oarlock.Calibration(noted={"kind": np.float64})
    with pytest.raises(DataError, match=r'"noted\.kind" is .*float64.*TOML cannot hold'):
        noted.save(tmp_path / "cal.toml")


def test_a_strength_of_400_digits_in_a_study_is_refused(tmp_path):
    text = (STUDIES / "robustness_quick.toml").read_text(encoding="utf-8")
    (tmp_path / "study.toml").write_text(
        text.replace("[1, 2, 5, 10, 20]", f"[1, 2, 5, 1{'0' * 400}]"), encoding="utf-8"
    )
    with pytest.raises(DataError, match="expected a finite number"):
        oarlock.studies.load_study(tmp_path / "study.toml", SIMULATORS)


@pytest.mark.parametrize(
    "text", ["seeds = " + "1" * 5000, "seeds = " + "[" * 3000, "seeds = " + "{a=" * 3000]
)
def test_a_toml_file_that_its_parser_cannot_take(tmp_path, text):
    file = tmp_path / "study.toml"
    file.write_text(text, encoding="utf-8")
    assert_refused(lambda: oarlock.studies.load_study(file), "study.toml: is not valid TOML")


def test_a_number_of_hundreds_of_digits(tmp_path):
    file = tmp_path / "plan.toml"
    step = '[[step]]\nname = "a"\nkind = "still"\n'
    file.write_text(f"format = 1\nposture_std_rad = 1{'0' * 400}\n{step}", encoding="utf-8")
    with pytest.raises(
        DataError, match=r'plan\.toml:2, key "posture_std_rad": is 1000.*expected a finite number'
    ):
        oarlock.calibration.load_session_plan(file)
    for kind in (oarlock.recording.Clock, oarlock.recording.EncoderScale):
        assert_refused(partial(kind, 10**400), "is too large for a floating-point number")


@pytest.mark.parametrize(
    ("key", "given", "said"),
    [
        ("kind", 3, "expected a text"),
        ("start_s", "x", "kind: is|dtype"),
        ("start_s", float("nan"), "finite"),
        ("pose", [1], "expected a table"),
        ("pose", {"x": float("inf")}, '"x": is inf'),
        ("joints", 3, "list of names"),
        ("joints", "elbow", "list of names"),
        ("axis", (0, 0, 0), "direction"),
        ("axis", (1, 0), "shape"),
        ("first", np.zeros(0), "1 or -1"),
        ("stream", None, "expected a text"),
        ("value", None, "dtype"),
        ("posture_std_rad", 0.0, "between 0 and 1"),
    ],
)
def test_a_step_with_a_value_of_another_kind(key, given, said):
    with pytest.raises(DataError, match=rf'plan, step "one": {key}.*({said})'):
        oarlock.calibration.SessionStep(**({"name": "one", "kind": "still", "end_s": 9.0} | {key: given}))


@pytest.mark.parametrize(("steps", "std_rad"), [(None, 0.1), ([3], 0.1), ((), 0.1), (None, None)])
def test_a_plan_of_something_else_than_steps(steps, std_rad):
    assert_refused(lambda: oarlock.calibration.SessionPlan("p", steps, std_rad), 'plan "p"')


@pytest.mark.parametrize(
    "counted",
    [{}, {"after_s": [0.1], "packets": [], "step_s": [0.1]}, {"after_s": "x", "packets": 1, "step_s": 2}],
)
def test_a_recording_whose_meta_counts_no_packets(counted):
    time_s = np.arange(5) / 50.0
    stream = oarlock.recording.ScalarStream("seat", time_s, 0.0 * time_s)
    recording = oarlock.Recording([stream], {"packets": {"seat": counted}})
    assert_refused(lambda: lost_packets(recording, stream), 'meta, packets of "seat"')


@pytest.fixture
def c3d(tmp_path):
    c3d_file(tmp_path / "trial.c3d", ["A", "B"])
    return tmp_path / "trial.c3d"


def changed(file, at, value):
    content = bytearray(file.read_bytes())
    content[at : at + len(value)] = value
    file.write_bytes(content)


def test_a_c3d_header_that_announces_gigabytes(c3d):
    changed(c3d, 8, struct.pack("<H", 60_000))
    with pytest.raises(
        DataError, match=r"trial\.c3d: .*header states 60000 frames, but it contains 4; was it cut off"
    ):
        oarlock.markers.load_markers(c3d)


def test_a_c3d_parameter_that_announces_gigabytes(c3d):
    content = c3d.read_bytes()
    labels = content.index(b"LABELS")
    dimensions = labels + len(b"LABELS") + 2 + 2
    changed(c3d, dimensions - 1, bytes([7]) + b"\xff" * 7)
    with pytest.raises(DataError, match=r"trial\.c3d: .*bad_alloc"):
        oarlock.markers.load_markers(c3d)


@pytest.mark.parametrize("kept", [0.25, 0.9])
def test_a_c3d_that_was_cut_off(tmp_path, kept, monkeypatch):
    """ezc3d reads on without end; the limit of processor time that ends it is 1 s here instead of 6."""
    text = child_process._CHILD.read_text(encoding="utf-8")
    assert text.count("_BYTES_PER_SECOND = 6,") == 1
    child = tmp_path / "reader_child.py"
    child.write_text(text.replace("_BYTES_PER_SECOND = 6,", "_BYTES_PER_SECOND = 1,"), encoding="utf-8")
    monkeypatch.setattr(child_process, "_CHILD", child)
    file = tmp_path / "trial.c3d"
    c3d_file(file, [f"M{k}" for k in range(20)])
    content = file.read_bytes()
    file.write_bytes(content[: int(kept * len(content))])
    assert_refused(lambda: oarlock.markers.load_markers(file), "trial.c3d")


@pytest.mark.parametrize(
    ("child", "limits", "said"),
    [
        ("import time; a = b'x' * 300_000_000; time.sleep(60)", (10**8, 600), "more than 100.0 MB of memory"),
        ("import time; time.sleep(60)", (10**9, 0.1), "more than 0 s"),
    ],
)
def test_the_parent_ends_a_reader_without_limits_of_its_own(child, limits, said, c3d, tmp_path, monkeypatch):
    """As on Windows and macOS, whose systems limit no child's memory."""
    (tmp_path / "child.py").write_text(child, encoding="utf-8")
    monkeypatch.setattr(child_process, "_CHILD", tmp_path / "child.py")
    monkeypatch.setattr(child_process, "limits_of", lambda file: limits)
    assert_refused(lambda: oarlock.markers.load_markers(c3d), f"its reader took {said}")


def test_a_c3d_parameter_that_should_hold_a_number_and_holds_none(c3d):
    """ezc3d ends the process on it."""
    analog = c3d.read_bytes().index(b"ANALOG")
    used = c3d.read_bytes().index(b"USED", analog)
    changed(c3d, used + len(b"USED") + 2 + 1, bytes([2, 0, 0]))
    with pytest.raises(DataError, match=r"trial\.c3d: .*its reader was ended by SIG\w+"):
        oarlock.markers.load_markers(c3d)


def test_notes_that_are_nested_too_deeply_are_refused(tmp_path):
    deep = f"[meta.{'.'.join('a' * 2000)}]\nb = 1\n"
    oarlock.Recording([oarlock.recording.ScalarStream("seat", [0.0, 1.0], value=[0.0, 0.1])]).save(tmp_path)
    (tmp_path / "oarlock-manifest.toml").unlink()  # as a person who writes a folder would leave it
    index = tmp_path / "recording.toml"
    index.write_text(index.read_text(encoding="utf-8").replace("[meta]", "") + deep, encoding="utf-8")
    assert_refused(lambda: oarlock.load_recording(tmp_path), "recording, meta: tables are nested too deeply")


def test_a_small_matlab_file_that_unpacks_to_hundreds_of_megabytes(tmp_path):
    file = matlab_file(tmp_path, compressed=True, imu_gyr=np.zeros((12_000_000, 3)))
    assert file.stat().st_size < 400_000
    assert_refused(lambda: read_broad(file), "it unpacks to 288 MB, more than the 27")


def test_a_zip_file_with_an_entry_without_a_name(tmp_path):
    """`zipfile` raises an IndexError, since Python 3.13 it reads an empty name."""
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.writestr("Z", "x")
    damaged(tmp_path / "a.zip", b"Z", b"\x00")
    assert_refused(lambda: find_recordings(tmp_path / "a.zip"), "a.zip: c", " unpacked")


def test_names_that_repeat_get_numbers():
    assert numbered(["a", "a", "a_2", "a", "b"], taken=["b"]) == ["a", "a_2", "a_2_2", "a_3", "b_2"]
    assert len(set(numbered(["a"] * 50_000))) == 50_000
