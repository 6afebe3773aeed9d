"""Files of which nobody said the format, with wounds: recognised and read, or refused with a reason."""

import shutil
from pathlib import Path

import pytest
from hypothesis import strategies as st

import oarlock
from fuzz_campaign import answered, campaign
from fuzz_wounds import byte_wounds, wounded, wounded_bytes, wounds
from oarlock.formats.contents import find_recordings, read_found
from oarlock.formats.datasets.mat_names import mat_names
from oarlock.formats.table.header import channel_of
from oarlock.recording.session_info import read_session
from oarlock.recording.unit_names import assign_units, place_of_name, read_units_file
from test_fuzz_files import matlab_files, put
from test_table import HEADER, columns_of, table

ROOT = Path(__file__).parents[1]
CLUB = ROOT / "examples/club_csv"


def short(rows=40):
    return columns_of()[:: len(columns_of()) // rows]


TABLES = {
    "plain.csv": table(HEADER, short()),
    "german.csv": table(HEADER, short(), ";", ",", "Gerät;7\n\n"),
    "tabs.txt": table(HEADER, short(), "\t", units=["s", *["deg/s"] * 3, *["g"] * 3, *["a.u."] * 3]),
    "counted.dat": table(["Frame", *HEADER[1:]], short(), above="Rate: 100 Hz\n"),
}


def read_all(place):
    """Every recording of a place, read or refused."""
    contents = answered(lambda: find_recordings(place))
    for one in contents.recordings if contents else ():
        recording = answered(lambda one=one: read_found(one))
        assert recording is None or recording.duration_s >= 0.0


@pytest.mark.parametrize("name", TABLES)
def test_tables(name, tmp_path):
    def check(harm):
        put(tmp_path / name, wounded(TABLES[name], harm))
        read_all(tmp_path / name)

    campaign(check, wounds)


def test_folders_and_zip_files(tmp_path):
    place = tmp_path / "place"
    shutil.copytree(CLUB, place)
    (place / "arm.csv").write_text(TABLES["plain.csv"])
    whole = {file: file.read_bytes() for file in sorted(place.iterdir())}
    packed = Path(shutil.make_archive(str(tmp_path / "a"), "zip", place)).read_bytes()

    def check(which, harm, zip_harm):
        for file, content in whole.items():
            file.write_bytes(content)
        file = sorted(whole)[which % len(whole)]
        file.write_bytes(wounded_bytes(whole[file], harm))
        read_all(place)
        (tmp_path / "a.zip").write_bytes(wounded_bytes(packed, zip_harm))
        read_all(tmp_path / "a.zip")
        assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.zip", "place"]

    campaign(check, st.integers(0, 9), byte_wounds, byte_wounds)


def test_variables_of_matlab_files(tmp_path):
    matlab_files(tmp_path)
    whole = [file.read_bytes() for file in sorted(tmp_path.glob("*.mat"))]

    def check(which, harm):
        (tmp_path / "wounded").write_bytes(wounded_bytes(whole[which % len(whole)], harm))
        assert all(isinstance(name, str) for name in mat_names(tmp_path / "wounded"))

    campaign(check, st.integers(0, 2), byte_wounds)


def test_small_files_of_people(tmp_path):
    texts = {
        "session.toml": 'athlete = "A07"\ndate = 2026-05-01\n',
        "units.toml": '[units]\n00B4 = "r_forearm"\n',
    }

    def check(which, harm):
        name = sorted(texts)[which]
        put(tmp_path / name, wounded(texts[name], harm))
        read = read_session if name == "session.toml" else lambda folder: read_units_file(folder / name)
        answered(lambda: read(tmp_path))

    campaign(check, st.integers(0, 1), wounds)


def test_any_text_as_a_name():
    sensors = ["pelvis", "forearm_r", "forearm_l"]

    def check(name, other):
        channel = channel_of(name, other)
        assert channel is None or channel.axis in "wxyz01234"
        place_of_name(name)
        answered(lambda: assign_units(sensors, [name, f"{other} "]))

    alphabet = st.text(st.sampled_from("RLrlaAcCgGmM xyzXYZ_-.:[]()/qQ0123456789sS²µ°\x00é"), max_size=30)
    campaign(check, alphabet | st.text(max_size=20), alphabet)


READERS = (find_recordings, oarlock.import_recording)


@pytest.mark.parametrize(
    "place", ["", "nothing_here", "a folder", "a\x00b", "x" * 300, "noise.csv", "noise.zip"]
)
def test_places_that_hold_nothing(place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a folder").mkdir()
    for name in ("noise.csv", "noise.zip"):
        Path(name).write_bytes(bytes(range(256)) * 4)
    for read in READERS:
        with pytest.raises(oarlock.DataError) as refusal:
            read(place)
        assert len(str(refusal.value)) > 10
