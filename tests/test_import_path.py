"""`oarlock import PATH`: what is recognised in files, folders and zip files, what is written, refused and said."""

import json
import shutil
import stat
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

import oarlock
from command_line import run
from local_data import local_folder
from oarlock.cli import app, import_
from oarlock.formats import archive
from oarlock.formats.choices import UnclearError
from oarlock.formats.contents import find_recordings, import_recording
from oarlock.formats.datasets.mat_names import mat_names
from oarlock.formats.importers import ImportFormat
from oarlock.formats.listing import FileMatch
from test_table import HEADER, columns_of, table

ROOT = Path(__file__).parents[1]
APDM = ROOT / "examples/pendulum/imuData01.csv"
CLUB = ROOT / "examples/club_csv"


@pytest.fixture
def arm(tmp_path):
    """A table of text of one unit."""
    file = tmp_path / "arm.csv"
    file.write_text(table(HEADER, columns_of()))
    return file


@pytest.fixture
def mixed(tmp_path):
    """A folder with recordings of three formats and other files."""
    place = tmp_path / "mixed"
    shutil.copytree(CLUB, place / "club")
    (place / "day 1").mkdir()
    (place / "day 2").mkdir()
    shutil.copy(APDM, place / "day 1/imuData01.csv")
    for day in ("day 1", "day 2"):
        (place / day / "arm.csv").write_text(table(HEADER, columns_of()))
    (place / "notes.txt").write_text("windy\n")
    (place / ".hidden").write_text("no\n")
    return place


def test_one_recording_is_written_and_described(arm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = run("import", arm).stdout
    assert "Wrote arm-recording" in said and "accelerometer read as m/s2" in said
    assert oarlock.load_recording("arm-recording").names == ("imu",)
    run("import", arm, status=2)  # the folder exists
    assert "arm-recording exists" in run("import", arm, status=2).stderr
    run("import", "--force", arm)


def test_a_format_in_front_reads_it_as_that(arm, tmp_path):
    run("import", "table", arm, "--accel-unit", "g", "--gyro-unit", "rad/s", "--out", tmp_path / "rec")
    assert oarlock.load_recording(tmp_path / "rec")["imu"].accel_m_s2.max() > 50.0


@pytest.fixture
def terminal(monkeypatch):
    """A person at the terminal."""
    monkeypatch.setattr(import_, "asks_questions", lambda no_questions, _: not no_questions)

    def typed(answers, *words):
        done = CliRunner().invoke(app, [str(word) for word in words], input=answers, prog_name="oarlock")
        assert done.exit_code == 0, done.output
        return done.output

    return typed


def test_a_terminal_asks_what_is_not_clear_and_who_it_was(tmp_path, terminal):
    (tmp_path / "a.csv").write_text(table(HEADER[1:], columns_of(scale_accel=0.3)[:, 1:]))
    answers = "100\nstone\ng\nA07\nyesterday\n2026-05-01\n\n\n\n\n\n"
    said = terminal(answers, "import", tmp_path / "a.csv", "--out", tmp_path / "rec")
    recording = oarlock.load_recording(tmp_path / "rec")
    assert recording.meta["session"] == {"athlete": "A07", "date": "2026-05-01"}
    assert recording["imu"].rate_hz == pytest.approx(100.0) and recording["imu"].accel_m_s2.max() > 20.0
    assert '"yesterday" is no date' in said and "times gravity" in said
    units = ("--rate-hz", "100", "--accel-unit", "g")
    terminal("", "import", tmp_path / "a.csv", "--out", tmp_path / "b", "--no-questions", *units)
    assert "session" not in oarlock.load_recording(tmp_path / "b").meta


def test_a_terminal_asks_which_unit_sits_where(arm, tmp_path, terminal):
    """The one unit of the table is called "imu", which says nothing."""
    words = ("import", arm, "--model", "arm", "--athlete", "A07")
    said = terminal("hand\n\n\nimu\ny\n", *words, "--out", tmp_path / "rec")
    assert "oarlock calibrate units" in " ".join(said.split()) and "Which unit is which" in said
    assert oarlock.load_recording(tmp_path / "rec").names == ("forearm_r",)
    assert 'imu = "forearm_r"' in (arm.parent / "units.toml").read_text()
    again = terminal("", *words, "--out", tmp_path / "again")  # units.toml says it now
    assert "Which unit is which" not in again
    assert oarlock.load_recording(tmp_path / "again").names == ("forearm_r",)


def test_two_formats_that_recognise_one_file(arm, monkeypatch):
    def find(one, listing):
        claims = one.name in ("apdm", "mvnx")
        return [FileMatch(one.name, listing.root, (listing.root,), "x", f"as {one.name}")] if claims else []

    monkeypatch.setattr(ImportFormat, "find", find)
    with pytest.raises(UnclearError, match=r"oarlock import apdm .*arm\.csv") as unclear:
        find_recordings(arm)
    assert unclear.value.choices == {"apdm": "as apdm", "mvnx": "as mvnx"}
    assert [one.format for one in find_recordings(arm, ["mvnx"]).recordings] == ["mvnx"]
    assert "several formats" in run("import", arm, "--no-questions", status=1).stderr


def test_the_list_has_the_start_of_tables_that_know_it(arm, tmp_path):
    rows = columns_of()
    rows[:, 0] += 1.7e9
    np.savetxt(tmp_path / "dated.csv", rows, "%.3f", ",", header=",".join(HEADER), comments="")
    starts = {one.name: one.start for one in find_recordings(tmp_path).recordings}
    assert starts == {"arm": "", "dated": "2023-11-14 22:13:20.00 UTC"}
    assert "2023-11-14 22:13:20.00" in run("import", tmp_path, status=1).stdout


def test_json_is_one_document(arm, tmp_path):
    found = json.loads(run("import", arm, "--out", tmp_path / "rec", "--json", "--athlete", "A07").stdout)
    assert found["session"] == {"athlete": "A07"} and found["about"].startswith("table of text, 1 unit")
    (stream,) = found["streams"]
    assert stream["kind"] == "imu" and stream["missing_percent"] == 0.0
    assert set(stream["quantities_hz"]) == {"gyro", "accel", "mag"}


def test_a_folder_lists_its_recordings(mixed):
    contents = find_recordings(mixed)
    assert {one.name: one.format for one in contents.recordings} == {
        "club": "csv",
        "imuData01": "apdm",
        "day 1_arm": "table",
        "day 2_arm": "table",
    }
    assert "notes.txt" in [contents.relative(file) for file in contents.others]
    assert all(Path(file).name not in ("rumpf.csv", "rollsitz.csv") for file in contents.others)
    listing = run("import", mixed, status=1)
    assert "imuData01" in listing.stdout and "--pick" in listing.stdout and "notes.txt" in listing.stdout
    assert "nothing was written" in listing.stderr
    listed = json.loads(run("import", mixed, "--json", status=1).stdout)
    assert [one["name"] for one in listed["recordings"]] == [one.name for one in contents.recordings]
    assert "notes.txt" in listed["unused_files"]


def test_all_and_pick(mixed, tmp_path):
    run("import", mixed, "--pick", "day 2_arm", "--out", tmp_path / "one")
    assert oarlock.load_recording(tmp_path / "one").names == ("imu",)
    said = run("import", mixed, "--pick", "day 3_arm", "--out", tmp_path / "none", status=1).stderr
    assert 'Did you mean "day 2_arm"?' in said
    run("import", mixed, "--all", "--pick", "club", status=2)
    (mixed / "day 2/arm.csv").write_text(table(HEADER, columns_of()) + "9,x,,,,,,,,\n")
    every = ("import", mixed, "--all", "--out", tmp_path / "every", "--athlete", "A07")
    done = json.loads(run(*every, "--json", status=1).stdout)
    assert [one["name"] for one in done["refused"]] == ["day 2_arm"] and len(done["recordings"]) == 3
    said = run(*every, "--force", status=1).stdout
    assert "day 2_arm" in said.partition("Refused")[2] and "Wrote" in said
    written = sorted(place.name for place in (tmp_path / "every").iterdir())
    assert written == ["club", "day%201_arm", "imuData01"]
    assert oarlock.load_recording(tmp_path / "every/imuData01").meta["session"] == {"athlete": "A07"}
    shutil.rmtree(tmp_path / "every/club")
    run(
        "import", mixed, "--all", "--out", tmp_path / "every", status=2
    )  # nothing is written if a folder is there
    assert not (tmp_path / "every/club").exists()


def test_in_python(mixed, arm):
    assert import_recording(arm).names == ("imu",)
    assert oarlock.import_recording(mixed, "club").names == ("back", "seat")
    with pytest.raises(oarlock.DataError, match=r"contains 4 recordings\. .*--together; else pick one: club"):
        import_recording(mixed)
    assert import_recording(arm, options={"accel_unit": "g"})["imu"].accel_m_s2.max() > 50.0


def test_a_zip_file_is_unpacked_safely(mixed, tmp_path):
    packed = shutil.make_archive(str(tmp_path / "session"), "zip", mixed)
    contents = find_recordings(packed)
    folder = contents.listing.root
    assert len(contents.recordings) == 4 and folder.is_dir()
    assert import_recording(packed, "club").names == ("back", "seat")
    del contents
    assert not folder.exists()


def evil(file, names=("a.csv",), text="x" * 10, mode=None):
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        for name in names:
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            if mode is not None:
                entry.external_attr = mode << 16
            made.writestr(entry, text)
    return file


@pytest.mark.parametrize("name", ["../out.csv", "/out.csv", "a/../../out.csv", "C:\\out.csv", "..\\out.csv"])
def test_names_that_lead_out_of_a_zip_file(tmp_path, name):
    with pytest.raises(oarlock.DataError, match="leads out of it"):
        find_recordings(evil(tmp_path / "a.zip", [name]))
    assert not (tmp_path.parent / "out.csv").exists()


def test_zip_files_that_are_refused(tmp_path, monkeypatch):
    with pytest.raises(oarlock.DataError, match="contains the link"):
        find_recordings(evil(tmp_path / "link.zip", text="/etc/passwd", mode=stat.S_IFLNK | 0o777))
    with pytest.raises(oarlock.DataError, match="times its size"):
        find_recordings(evil(tmp_path / "bomb.zip", text="0" * 40_000_000))
    monkeypatch.setattr(archive, "LIMIT_BYTES", 5)
    with pytest.raises(oarlock.DataError, match="unpacks to 10 bytes"):
        find_recordings(evil(tmp_path / "large.zip"))
    whole = evil(tmp_path / "cut.zip", text="ab" * 2).read_bytes()
    for end in (4, 30, len(whole) - 10):
        (tmp_path / "cut.zip").write_bytes(whole[:end])
        with pytest.raises(oarlock.DataError, match=r"cut\.zip"):
            find_recordings(tmp_path / "cut.zip")


def test_what_was_looked_at_is_named_if_nothing_is_recognised(tmp_path):
    (tmp_path / "a.csv").write_text("time,power\n0,1\n1,2\n2,3\n")
    (tmp_path / "b.mat").write_bytes(b"none")
    (tmp_path / "c.pdf").write_bytes(b"%PDF")
    (tmp_path / "d.csv").touch()
    said = run("import", tmp_path, status=1).stderr
    for words in (
        "4 files were looked at",
        "a.csv: nearest format table",
        "d.csv: is empty",
        ".pdf",
        "mapping",
    ):
        assert words in said
    assert "does not exist" in run("import", tmp_path / "nowhere", status=1).stderr
    (tmp_path / "empty").mkdir()
    assert "contains no files" in run("import", tmp_path / "empty", status=1).stderr


def test_a_mapping_with_a_mistake_says_the_mistake(tmp_path):
    shutil.copytree(CLUB, tmp_path / "club")
    mapping = tmp_path / "club/mapping.toml"
    mapping.write_text(mapping.read_text().replace('unit = "deg/s"', 'unit = "dag/s"'))
    assert "dag/s" in run("import", mapping, "--out", tmp_path / "rec", status=1).stderr


def test_a_recording_of_oarlock_is_not_imported_again(arm, tmp_path):
    run("import", arm, "--out", tmp_path / "rec")
    oarlock.load_recording(tmp_path / "rec").save(tmp_path / "as_csv", "csv")
    assert [one.name for one in find_recordings(tmp_path).recordings] == ["arm"]
    assert "is a recording of Oarlock already" in run("import", tmp_path / "rec", status=1).stderr


def test_save_mapping(arm, mixed, tmp_path):
    run("import", arm, "--out", tmp_path / "rec", "--save-mapping", tmp_path / "used.toml")
    run("import", "csv", tmp_path / "used.toml", "--out", tmp_path / "again")
    one, again = (oarlock.load_recording(tmp_path / name)["imu"] for name in ("rec", "again"))
    np.testing.assert_array_equal(one.accel_m_s2, again.accel_m_s2)
    said = run(
        "import", mixed, "--pick", "club", "--out", tmp_path / "x", "--save-mapping", "y.toml", status=2
    )
    assert "--save-mapping: the format csv has no such option (table has it)" in said.stderr


def test_options_of_a_reader_are_options_of_the_path(tmp_path):
    still = columns_of(0.0)
    (tmp_path / "a.csv").write_text(table(HEADER, still))
    run("import", tmp_path / "a.csv", "--out", tmp_path / "rec", status=1)
    run("import", tmp_path / "a.csv", "--out", tmp_path / "rec", "--gyro-unit", "deg/s")
    assert oarlock.load_recording(tmp_path / "rec")["imu"].gyro_rad_s.max() == 0.0


@pytest.mark.parametrize("compressed", [True, False])
def test_variables_of_matlab_files(tmp_path, compressed):
    segment = {"gyr": np.zeros((500, 3)), "acc": np.zeros((500, 3)), "a_longer_name": 1.0}
    content = {"t": np.arange(3.0), "upper_leg_left": segment, "x": "text"}
    savemat(tmp_path / "a.mat", content, do_compression=compressed)
    found = mat_names(tmp_path / "a.mat")
    assert found == {"t": (), "upper_leg_left": ("gyr", "acc", "a_longer_name"), "x": ()}
    whole = (tmp_path / "a.mat").read_bytes()
    for end in (0, 100, 130, 200, len(whole) // 2):
        (tmp_path / "a.mat").write_bytes(whole[:end])
        assert mat_names(tmp_path / "a.mat").items() <= found.items()


@pytest.mark.parametrize(
    ("folder", "format", "count"),
    [
        ("qmt_full_body", "qmt", 1),
        ("broad", "broad", 7),
        ("dfjimu", "dfjimu", 5),
        ("openaxes_ur5", "openaxes", 4),
    ],
)
def test_data_sets_are_recognised(folder, format, count):
    found = find_recordings(local_folder(f"data/{folder}")).recordings
    assert [one.format for one in found] == [format] * count
