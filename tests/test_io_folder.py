import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from oarlock.recording.recording import Recording, load_recording
from oarlock.recording.streams import ImuStream, ScalarStream, VectorStream
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, toml_text
from refusals import assert_refused

TIME_S = np.arange(5) / 128.0
ROWS = np.linspace(-1.0, 1.0, 15).reshape(5, 3)
VALUES = st.floats(allow_infinity=False, allow_nan=True)


def bits(recording):
    return {
        (s.name, s.kind, field): values.tobytes()
        for s in recording
        for field, values in {"time_s": s.time_s, **s.values}.items()
    }


def example():
    return Recording(
        [
            ImuStream("back", TIME_S, gyro_rad_s=ROWS, mag_ut=40 * ROWS),
            ScalarStream("seat", TIME_S, ROWS[:, 0], unit="m"),
            VectorStream("wrist", TIME_S, ROWS),
        ],
        {"athlete": "A07", "rig": {"span_m": 1.6, "pins": [0.1, 0.2]}},
    )


@pytest.fixture
def folder(tmp_path):
    example().save(tmp_path / "trial")
    return tmp_path / "trial"


def refused(folder, *words):
    assert_refused(lambda: load_recording(folder), *words)


def edit(folder, old, new):
    file = folder / "recording.toml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize("file_format", ["parquet", "csv"])
@settings(max_examples=25, deadline=None)
@given(rows=hnp.arrays(np.float64, (4, 3), elements=VALUES), steps=hnp.arrays(np.uint8, 4))
def test_every_bit_comes_back(tmp_path_factory, file_format, rows, steps):
    rows = np.where(np.isnan(rows), np.nan, rows)
    time_s = 1.5e9 + np.cumsum(steps + 1.0) / 3.0
    recording = Recording(
        [
            ImuStream("back", time_s, accel_m_s2=rows),
            ScalarStream("seat", time_s, rows[:, 0], unit="rad"),
            VectorStream("wrist", time_s, rows),
        ]
    )
    folder = tmp_path_factory.mktemp("trial")
    recording.save(folder, file_format)
    again = load_recording(folder)
    assert bits(again) == bits(recording)
    assert again["seat"].unit == "rad"


def test_meta_comes_back(folder):
    assert load_recording(folder / "recording.toml").meta == example().meta


def test_time_is_the_first_column(folder):
    assert pq.read_table(folder / "back.parquet").column_names[0] == "time_s"


def test_saving_again_leaves_nothing_of_the_old(folder):
    Recording([ScalarStream("seat", TIME_S, ROWS[:, 0])]).save(folder, "csv")
    assert sorted(p.name for p in folder.iterdir()) == ["oarlock-manifest.toml", "recording.toml", "seat.csv"]


def test_names_that_no_file_can_have(tmp_path):
    names = ("../back", "__/back", "Back", "back", "Rücken links")
    recording = Recording([ScalarStream(n, TIME_S, ROWS[:, 0]) for n in names])
    recording.save(tmp_path / "trial")
    assert load_recording(tmp_path / "trial").names == names
    assert [p.name for p in tmp_path.iterdir()] == ["trial"]


def test_meta_that_cannot_be_written(tmp_path):
    with pytest.raises(DataError, match=r'"meta.rig" is None'):
        Recording([ScalarStream("seat", TIME_S, ROWS[:, 0])], {"rig": None}).save(tmp_path / "t")


def test_no_recording(tmp_path):
    refused(tmp_path / "nowhere", "is not a recording", "oarlock import")


def test_missing_file(folder):
    (folder / "back.parquet").unlink()
    refused(folder, "there is no file", "back.parquet", "recording.toml:")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('gyro = "rad/s"', 'gyro = "deg/s"', ["deg/s", "rad/s", 'key "gyro"', "oarlock import csv"]),
        ('kind = "imu"', 'kind = "imo"', ["'imo'", "imu"]),
        ('name = "back"', 'nam = "back"', ['key "nam"', "recording.toml:4", 'Did you mean "name"?']),
        ("format = 1", "format = 2", ["format 1"]),
        ("rows = 5", "rows = 6", ["6 rows", "has 5", "back.parquet"]),
        ('mag = "uT"', 'accel = "m/s2"', ['no column "accel_x_m_s2"', "back.parquet"]),
        ('file = "back.parquet"', 'file = "../back.parquet"', ["not inside"]),
        ("rows = 5", "rows = ", ["not valid TOML", "line 7"]),
    ],
)
def test_mistakes_in_the_index(folder, old, new, words):
    edit(folder, old, new)
    refused(folder, *words)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"time_s": TIME_S, "value": ROWS[:, 0], "vlaue": ROWS[:, 0]}, 'does not list the column "vlaue"'),
        ({"time_s": TIME_S, "value": ["a"] * 5}, 'column "value" is of type string'),
    ],
)
def test_columns_that_do_not_fit(folder, columns, words):
    pq.write_table(pa.table(columns), folder / "seat.parquet")
    refused(folder, words)


def test_file_that_is_no_parquet(folder):
    (folder / "seat.parquet").write_text("time_s,value\n")
    refused(folder, "cannot be read as Parquet")


TOML_VALUES = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abß. \"'\n"), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.text("aZ_-é\\\t"), TOML_VALUES, max_size=4))
def test_toml_comes_back(tmp_path_factory, document):
    file = tmp_path_factory.getbasetemp() / "any.toml"
    file.write_bytes(toml_text(document).encode())
    assert TomlTable.read(file).values == document
