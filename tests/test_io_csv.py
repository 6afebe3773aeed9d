import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oarlock.formats.csv import read_csv
from oarlock.recording.packets import quantity_rates
from oarlock.recording.plausibility import plausibility
from oarlock.storage.errors import DataError
from oarlock.storage.units import STANDARD_GRAVITY_M_S2
from refusals import assert_refused
from test_docs import blocks

ROOT = Path(__file__).parents[1]
CLUB = ROOT / "examples/club_csv"
PAGE = ROOT / "docs/import.md"

SEAT = """format = 1
[[file]]
path = "a.csv"
time = { column = "t", unit = "s" }
[[file.sensor]]
name = "seat"
value = { column = "x", unit = "m" }
"""
IMU = """format = 1
[[file]]
path = "a.csv"
time = { column = "t", unit = "s" }
[[file.sensor]]
name = "back"
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
"""


@pytest.fixture
def trial(tmp_path):
    def write(mapping, encoding="utf-8", **texts):
        (tmp_path / "mapping.toml").write_text(mapping, encoding="utf-8")
        for name, text in texts.items():
            (tmp_path / f"{name}.csv").write_bytes(text.encode(encoding))
        return tmp_path / "mapping.toml"

    return write


def refused(mapping, *words):
    assert_refused(lambda: read_csv(mapping), *words)


def seat(trial, text, *, encoding="utf-8", **keys):
    """The seat's stream from a file whose mapping has these further keys."""
    lines = "".join(f"{k} = {v}\n" for k, v in keys.items())
    return read_csv(trial(SEAT.replace("time =", lines + "time ="), encoding, a=text))["seat"]


def timed(unit):
    return SEAT.replace('unit = "s"', f'unit = "{unit}"')


# --- the example ------------------------------------------------------------------------------------------


def test_example_reads_into_si():
    recording = read_csv(CLUB / "mapping.toml")
    back, seat_stream = recording["back"], recording["seat"]
    assert (len(back), len(seat_stream)) == (200, 100)
    assert back.rate_hz == pytest.approx(50.0)
    assert seat_stream.time_s[0] == 0.005
    assert recording.meta["clock"] == {"kind": "clock", "zero": "18:59:58.000000000"}
    assert recording.meta["athlete"] == "A07"
    # first row of rumpf.csv: Acc Y = -0,9968 g with the axis turned round
    assert back.accel_m_s2[0, 1] == 0.9968 * STANDARD_GRAVITY_M_S2
    assert np.isnan(back.mag_ut[1]).all()
    # first row of rollsitz.csv: 20,4 mm, less 20 mm
    assert seat_stream.value[0] == pytest.approx(0.0004)
    assert seat_stream.unit == "m"
    # the magnetometer has a reading in every second row: its own rate, not missing readings
    assert quantity_rates(recording, back)["mag_ut"] == pytest.approx(25.0, rel=0.01)
    assert plausibility(recording) == []


def test_page_shows_the_example():
    (shown,) = (found for block in blocks(PAGE, "toml") if "file" in (found := tomllib.loads(block)))
    shipped = tomllib.loads((CLUB / "mapping.toml").read_text(encoding="utf-8"))
    assert shown["file"] == shipped["file"]
    assert (CLUB / "rumpf.csv").read_text(encoding="cp1252").startswith(blocks(PAGE, "text")[0])


@pytest.mark.parametrize("code", [code for code in blocks(PAGE, "python") if '"examples/' in code])
def test_page_code_runs(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    names = {}
    exec(compile(code, "docs/import.md", "exec"), names)
    assert len(names["recording"]) in (2, 4)


def test_one_mapping_serves_many_folders(trial, tmp_path):
    mapping = trial(SEAT)
    (tmp_path / "other").mkdir()
    (tmp_path / "other/a.csv").write_text("t,x\n0,1\n")
    assert read_csv(mapping, tmp_path / "other")["seat"].value.tolist() == [1.0]
    refused(mapping, "there is no file")


# --- how files are written --------------------------------------------------------------------------------

NUMBERS = st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20)


@settings(max_examples=50, deadline=None)
@given(
    NUMBERS,
    st.sampled_from([(",", "."), (";", ","), ("\t", ","), ("|", ".")]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    st.sampled_from(["\n", "\r\n"]),
)
def test_numbers_come_back_exactly(tmp_path_factory, values, marks, encoding, newline):
    delimiter, decimal = marks
    folder = tmp_path_factory.mktemp("trial")
    rows = [f"{i}{delimiter}{v!r}".replace(".", decimal) for i, v in enumerate(values)]
    (folder / "a.csv").write_bytes(newline.join([f"t{delimiter}x", *rows, ""]).encode(encoding))
    name = "utf-8" if encoding == "utf-8-sig" else encoding
    keys = f'delimiter = "{delimiter}"\ndecimal = "{decimal}"\nencoding = "{name}"\n'.replace("\t", "\\t")
    (folder / "m.toml").write_text(SEAT.replace("time =", keys + "time ="))
    stream = read_csv(folder / "m.toml")["seat"]
    assert stream.value.tolist() == values
    assert stream.time_s.tolist() == list(range(len(values)))


def test_missing_markers_and_blank_lines(trial):
    text = "t,x\n0,1\n\n1,\n2,NaN\n3,---\n4, nan \n5,2\n"
    assert np.isnan(seat(trial, text).value).tolist() == [False, True, True, True, True, False]
    assert np.isnan(seat(trial, "t,x\n0,-999\n", missing='["-999"]').value).all()


def test_columns_by_number_without_header(trial):
    mapping = SEAT.replace('column = "t"', "column = 1").replace('column = "x"', "column = 3")
    mapping = mapping.replace("time =", "header = false\nskip_rows = 1\ntime =")
    assert read_csv(trial(mapping, a="made by X\n0,7,1\n1,7,2\n"))["seat"].value.tolist() == [1.0, 2.0]
    refused(trial(mapping, a="made by X\n0,7\n"), "has no column 3")


def test_files_longer_than_one_batch(trial):
    rows = "".join(f"{i},{i / 7!r}\n" for i in range(45_000))
    stream = seat(trial, "t,x\n" + rows)
    assert stream.value.tolist() == [i / 7 for i in range(45_000)]
    refused(trial(SEAT, a="t,x\n" + rows + "45000,oops\n"), 'a.csv:45002, column "x"')


# --- units and axes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "unit", "si"),
    [
        ("gyro", "deg/s", np.pi / 180),
        ("accel", "g", STANDARD_GRAVITY_M_S2),
        ("accel", "m/s^2", 1.0),
        ("accel", "m/s²", 1.0),
        ("mag", "gauss", 100.0),
        ("mag", "mG", 0.1),
        ("mag", "nT", 0.001),
        ("mag", "µT", 1.0),
        ("position", "cm", 0.01),
    ],
)
def test_units(trial, key, unit, si):
    mapping = IMU.replace("gyro =", f"{key} =").replace("rad/s", unit)
    (values,) = read_csv(trial(mapping, a="t,gx,gy,gz\n0,1,2,3\n"))["back"].values.values()
    np.testing.assert_allclose(values, [[si, 2 * si, 3 * si]], rtol=1e-15)


def test_axes_scale_and_offset(trial):
    mapping = IMU.replace(
        'unit = "rad/s"', 'unit = "rad/s", axes = ["-z", "x", "y"], scale = 2, offset = [1, 0, 5]'
    )
    stream = read_csv(trial(mapping, a="t,gx,gy,gz\n0,1,2,3\n"))["back"]
    assert stream.gyro_rad_s.tolist() == [[-11.0, 3.0, 4.0]]


def test_angle_and_length_values(trial):
    degrees = read_csv(trial(SEAT.replace('unit = "m"', 'unit = "deg"'), a="t,x\n0,180\n"))["seat"]
    assert (degrees.unit, degrees.value[0]) == ("rad", np.pi)
    millimetres = read_csv(trial(SEAT.replace('unit = "m"', 'unit = "mm"'), a="t,x\n0,1\n"))["seat"]
    assert (millimetres.unit, millimetres.value[0]) == ("m", 0.001)


# --- time -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "cells", "seconds", "clock"),
    [
        ("ms", ["10", "20.5"], [0.01, 0.0205], {"kind": "relative"}),
        ("us", ["7812", "15625"], [0.007812, 0.015625], {"kind": "relative"}),
        (
            "epoch_ms",
            ["1700000000000", "1700000000007.8125"],
            [0.0, 0.0078125],
            {"kind": "utc", "zero": "2023-11-14T22:13:20.000000000Z"},
        ),
        ("epoch_s", ["1700000000.1", "1700000000.3"], [0.0, 0.2], None),
        ("epoch_us", ["1700000000000001", "1700000000000003"], [0.0, 2e-6], None),
        (
            "HH:MM:SS.fff",
            ["9:00:00.5", "09:00:01"],
            [0.0, 0.5],
            {"kind": "clock", "zero": "09:00:00.500000000"},
        ),
        ("clock", ["23:59:59.990", "00:00:00.010", "00:00:00.030"], [0.0, 0.02, 0.04], None),
        ("iso", ["2024-05-01T23:59:59.5", "2024-05-02 00:00:00.25"], [0.0, 0.75], None),
        (
            "iso",
            ["2024-05-01T12:00:00+02:00", "2024-05-01T10:00:01Z"],
            [0.0, 1.0],
            {"kind": "utc", "zero": "2024-05-01T10:00:00.000000000Z"},
        ),
    ],
)
def test_time_units(trial, unit, cells, seconds, clock):
    rows = "".join(f"{c},1\n" for c in cells)
    recording = read_csv(trial(timed(unit), a="t,x\n" + rows))
    assert recording["seat"].time_s.tolist() == seconds
    assert clock is None or recording.meta["clock"] == clock


def two_files(unit_a="s", unit_b="s", more=""):
    second = SEAT.split("\n", 1)[1].replace("a.csv", "b.csv").replace("seat", "oar")
    return SEAT.replace('"s"', f'"{unit_a}"') + second.replace('unit = "s"', f'unit = "{unit_b}"{more}')


def test_files_share_one_clock(trial):
    mapping = two_files("epoch_ms", "iso")
    recording = read_csv(trial(mapping, a="t,x\n1000,1\n", b="t,x\n1970-01-01T00:00:00.25Z,1\n"))
    assert (recording["seat"].time_s[0], recording["oar"].time_s[0]) == (0.75, 0.0)
    mapping = two_files("clock", "clock", ", offset_s = 2.5")
    recording = read_csv(trial(mapping, a="t,x\n23:59:59,1\n", b="t,x\n00:00:01,1\n"))
    assert (recording["seat"].time_s[0], recording["oar"].time_s[0]) == (0.0, 4.5)


def test_clocks_that_have_nothing_in_common(trial):
    mapping = trial(two_files("s", "clock"), a="t,x\n1,1\n", b="t,x\n00:00:01,1\n")
    refused(mapping, "b.csv", "time of day", "unnamed start")


def test_one_unit_in_two_files_has_all_stamps(trial):
    second = IMU.split("\n", 1)[1].replace("a.csv", "b.csv").replace("gyro", "mag").replace("rad/s", "uT")
    files = {"a": "t,gx,gy,gz\n0,1,2,3\n0.1,4,5,6\n", "b": "t,gx,gy,gz\n0.05,7,8,9\n0.1,1,1,1\n"}
    stream = read_csv(trial(IMU + second, **files))["back"]
    assert stream.time_s.tolist() == [0.0, 0.05, 0.1]
    assert np.isnan(stream.gyro_rad_s[:, 0]).tolist() == [False, True, False]
    assert stream.mag_ut[1:].tolist() == [[7.0, 8.0, 9.0], [1.0, 1.0, 1.0]]
    twice = IMU + IMU.split("\n", 1)[1]
    refused(trial(twice, **files), 'sensor "back" is already defined')


# --- mistakes in the data ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,x\n0,1\n1,oops\n", ['a.csv:3, column "x"', '"oops" is not a number']),
        ("t,x\n0,1\n1,1_0\n", ["a.csv:3", '"1_0"']),
        ("t,x\n0,inf\n", ["a.csv:2", '"inf"']),
        ("t,x\n0,1e999\n", ["a.csv:2", '"1e999"']),
        ('t,x\n0,"1,5"\n', ["a.csv:2", "1,5", 'decimal = ","']),
        ("t,x\n0,1\n1\n", ["a.csv:3", "1 fields", "the header has 2", "cut off"]),
        ("t,x\n0,1,\n", ["a.csv:2", "3 fields", "last delimiter"]),
        ("t;x\n0;1\n", ["column", "delimiter = ';'"]),
        ("t,X\n0,1\n", ['no column "x"', 'Did you mean "X"?', "mapping.toml:7"]),
        ("t,x,x\n0,1,1\n", ['column "x" is there 2 times', "2 and 3"]),
        ("t,x\n0,1\n,1\n", ['a.csv:3, column "t"', "time is missing"]),
        ("t,x\n0,1\n2,1\n1,1\n", ['a.csv:4, column "t"', "1.0 s", "2.0 s", "sort"]),
        ("t,x\n0,1\n0,1\n", ["a.csv:3", "repeats", "0.0 s"]),
        ("t,x\n", ["no rows of data"]),
        ("", ["no rows"]),
    ],
)
def test_mistakes_in_the_data(trial, text, words):
    refused(trial(SEAT, a=text), *words)


def test_a_point_where_the_decimal_mark_is_a_comma(trial):
    mapping = SEAT.replace("time =", 'delimiter = ";"\ndecimal = ","\ntime =')
    refused(trial(mapping, a="t;x\n0;1.234\n"), 'The decimal mark is ","')
    refused(trial(mapping, a="t;x\n0;1.234,5\n"), "1.234,5")


def test_wrong_encoding(trial):
    refused(trial(SEAT, "utf-16", a="t,x\n0,1\n"), 'encoding = "utf-16"')
    refused(trial(SEAT, "utf-16-le", a="t,x\n0,1\n"), 'encoding = "utf-16"')
    refused(trial(SEAT, "latin-1", a="t,x,ü\n0,1,2\n"), "latin-1")
    unknown = SEAT.replace("time =", 'encoding = "utf-88"\ntime =')
    refused(trial(unknown, a="t,x\n"), '"utf-88" is not known')


@pytest.mark.parametrize(
    ("unit", "cell", "words"),
    [
        ("clock", "25:00:00", ['a.csv:2, column "t"', '"25:00:00"', "14:03:27.250"]),
        ("clock", "12:00", ['"12:00"']),
        ("epoch_ms", "soon", ["a.csv:2", '"soon"', "epoch"]),
        ("epoch_ms", "nan", ["a.csv:2", '"nan"']),
        ("iso", "01.05.2024 10:00", ["a.csv:2", "ISO date-time"]),
        ("iso", "2024-05-01T10:00:00Z,1\n2024-05-01T10:00:01", ["a.csv:3", "time zone"]),
    ],
)
def test_times_that_cannot_be_read(trial, unit, cell, words):
    refused(trial(timed(unit), a=f"t,x\n{cell},1\n"), *words)


# --- mistakes in the mapping ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("path =", "pth =", ['mapping.toml:3, key "pth"', 'Did you mean "path"?']),
        ("time =", 'delimeter = ";"\ntime =', [":4", 'Did you mean "delimiter"?']),
        ("gyro =", "gyros =", [":7", 'key "gyros" of [file[1].sensor[1]]', 'Did you mean "gyro"?']),
        ('unit = "rad/s"', 'units = "rad/s"', [":7", 'Did you mean "unit"?']),
        ('unit = "rad/s"', 'unit = "m/s2"', [":7", "m/s2", "rad/s, deg/s"]),
        ('unit = "s"', 'unit = "sec"', [":4", "sec", "epoch_ms"]),
        ('"gz"]', '"gy"]', ["twice"]),
        (', "gz"]', "]", ["three columns"]),
        ('unit = "rad/s"', 'unit = "rad/s", axes = ["x", "y", "y"]', ["axes", "each of x, y and z once"]),
        ('unit = "rad/s"', 'unit = "rad/s", axes = ["x", "y", "--z"]', ["axes"]),
        ('unit = "rad/s"', 'unit = "rad/s", scale = 0', ["scale", "all readings would be 0"]),
        ('unit = "rad/s"', 'unit = "rad/s", offset = [1, 2]', ["2 numbers for 3 columns"]),
        ('unit = "rad/s"', 'unit = "rad/s", offset = true', ["True", "finite number"]),
        ("time =", 'decimal = ";"\ntime =', ["decimal", 'expected "." or ","']),
        ("time =", 'delimiter = ";;"\ntime =', ["delimiter", "one character"]),
        ("time =", "skip_rows = -1\ntime =", ["skip_rows", "0 or more"]),
        ("time =", "missing = 3\ntime =", ["missing", "list of texts"]),
        ('name = "back"\n', "", ['"name" is missing', "[file[1].sensor[1]]"]),
        ("format = 1", "format = 9", ["mapping.toml:1", "9", "format 1"]),
        ("format = 1", "format = ", ["not valid TOML", "line 1"]),
        ("gyro =", 'value = { column = "gx", unit = "m" }\ngyro =', ["mixes", "value, gyro"]),
        ('gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }', "", ["no quantity"]),
    ],
)
def test_mistakes_in_the_mapping(trial, old, new, words):
    assert old in IMU
    refused(trial(IMU.replace(old, new, 1), a="t,gx,gy,gz\n0,1,2,3\n"), "mapping.toml", *words)


def test_no_mapping(tmp_path):
    refused(tmp_path / "none.toml", "cannot be read")


# --- anything at all --------------------------------------------------------------------------------------

SCRAP = st.one_of(
    st.binary(max_size=12), st.sampled_from([b";;;", b'"', b"\n", b"=", b"[", b"]]", b"\x00", b"1e999"])
)


def reads_or_refuses(mapping):
    try:
        read_csv(mapping)
    except DataError as error:
        assert str(error)


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(["mapping.toml", "rumpf.csv", "rollsitz.csv"]), st.floats(0, 1), st.integers(0, 30), SCRAP
)
def test_damaged_files_are_read_or_refused(tmp_path_factory, damaged, place, cut, scrap):
    folder = tmp_path_factory.getbasetemp() / "damaged"
    folder.mkdir(exist_ok=True)
    for name in ("mapping.toml", "rumpf.csv", "rollsitz.csv"):
        whole = (CLUB / name).read_bytes()
        at = int(place * len(whole))
        (folder / name).write_bytes(whole[:at] + scrap + whole[at + cut :] if name == damaged else whole)
    reads_or_refuses(folder / "mapping.toml")


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from([*["s", "ms", "us", "clock", "iso", "epoch_s", "epoch_ms", "epoch_ns"]]),
    st.lists(st.text(st.characters(exclude_characters="\r\n\x00", exclude_categories=["Cs"])), max_size=4),
)
def test_any_time_text_is_read_or_refused(tmp_path_factory, unit, cells):
    folder = tmp_path_factory.getbasetemp() / "times"
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_text("t,x\n" + "".join(f"{c},1\n" for c in cells), encoding="utf-8")
    (folder / "m.toml").write_text(timed(unit))
    reads_or_refuses(folder / "m.toml")
