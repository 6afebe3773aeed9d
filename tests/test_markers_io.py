"""Marker files: C3D, TRC, CSV, the exports of Vicon Nexus and Qualisys; what is written is read back."""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from local_data import local_folder
from oarlock import DataError
from oarlock.markers import Markers, load_markers
from oarlock.storage.array_gate import LEAST_INTERVAL_S
from refusals import assert_refused

OPENSIM = Path(__file__).parent / "data/opensim"
SINGLE_PRECISION_M = 1e-6  # C3D holds mm as float32: 24 bits of some metres
PRINTED_M = 5.1e-5  # OpenSim's reference tables print mm with five digits, some metres from the origin
HOUR = 3600.0

coordinate = st.floats(-1e3, 1e3, allow_nan=False)
name = st.text(
    st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp", "Zs")), min_size=1, max_size=8
)
names = st.lists(name.filter(lambda n: ":" not in n), min_size=1, max_size=4, unique=True)


@st.composite
def any_markers(draw):
    chosen = draw(names)
    drawn = sorted(draw(st.lists(st.floats(-HOUR, HOUR), min_size=1, max_size=6)))
    stamps = drawn[:1] + [b for a, b in pairwise(drawn) if b - a >= LEAST_INTERVAL_S]
    cell = st.one_of(st.just((np.nan,) * 3), st.tuples(coordinate, coordinate, coordinate))
    row = st.tuples(*[cell] * len(chosen))
    return Markers(tuple(chosen), stamps, [draw(row) for _ in stamps])


def small() -> Markers:
    time_s = np.arange(5) / 100.0
    position = np.arange(30.0).reshape(5, 2, 3) / 1000.0
    position[2, 1] = np.nan
    return Markers(("LELB", "LWRI"), time_s, position)


def assert_same(found: Markers, wanted: Markers) -> None:
    assert found.names == wanted.names
    np.testing.assert_array_equal(found.time_s, wanted.time_s)
    np.testing.assert_array_equal(found.position_m, wanted.position_m)


@pytest.mark.parametrize("ending", ["trc", "csv"])
@settings(max_examples=40, deadline=None)
@given(markers=any_markers())
def test_written_markers_are_read_back_to_the_last_bit(tmp_path_factory, ending, markers):
    file = tmp_path_factory.mktemp("markers") / f"trial.{ending}"
    markers.save(file)
    assert_same(load_markers(file), markers)


@pytest.mark.parametrize("ending", ["trc", "csv", "tsv"])
@settings(max_examples=60, deadline=None)
@given(text=st.text(st.sampled_from(list("Frame#DataRateTimeXYZ\t,;\n 0123.4e-_nmx")), max_size=200))
def test_any_text_is_read_or_refused_with_a_data_error(tmp_path_factory, ending, text):
    file = tmp_path_factory.mktemp("markers") / f"trial.{ending}"
    file.write_text(text, encoding="utf-8")
    try:
        assert len(load_markers(file)) > 0
    except DataError as error:
        assert file.name in str(error)


@settings(max_examples=60, deadline=None)
@given(cut=st.integers(0, 2690), junk=st.text(max_size=3))
def test_a_spoilt_trc_is_read_or_refused_with_a_data_error(tmp_path_factory, cut, junk):
    text = (OPENSIM / "dataWithNaNsOfDifferentCases.trc").read_text(encoding="utf-8")
    file = tmp_path_factory.mktemp("markers") / "cut.trc"
    file.write_text(text[:cut] + junk, encoding="utf-8")
    try:
        assert load_markers(file).names[0]
    except DataError as error:
        assert "cut.trc" in str(error)


def test_trc_of_opensim_in_every_spelling_of_nothing():
    markers = load_markers(OPENSIM / "dataWithNaNsOfDifferentCases.trc")
    assert markers.names[0] == "toe"
    assert len(markers.names) == 14
    # NaN, NAN, Nan, nan: one marker is missing in all five frames
    np.testing.assert_array_equal(
        np.isnan(markers.position_m[:, :, 0]).sum(axis=0) > 0, [n == "thigh" for n in markers.names]
    )
    np.testing.assert_allclose(markers["toe"][0], [0.175798014, -0.333753526, 0.033121135])
    assert markers.rate_hz == pytest.approx(250.0)


def test_trc_with_exponents_in_metres_and_trailing_tabs():
    markers = load_markers(OPENSIM / "dataWithEformat.trc")
    np.testing.assert_allclose(markers["RFAsuperior"][0], [-0.273, 0.0746, -1.57])
    assert markers.time_s[0] == 0.008342
    assert markers.seen.all()


def test_trc_with_blanks_has_gaps():
    markers = load_markers(OPENSIM / "exampleFormat.trc")
    assert markers.names == ("marker1", "marker2", "marker3")
    assert not markers.seen[0, 0]
    np.testing.assert_allclose(markers["marker2"][0], [-0.152, 0.245, -1.71])


def test_trc_whose_names_stand_side_by_side(tmp_path):
    file = tmp_path / "side.trc"
    lines = ["PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumMarkers\tUnits", "100\t2\tmm"]
    lines += [
        "Frame#\tTime\t\tA\t\tB",
        "\t\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
        "",
        "1\t0\t1\t2\t3\t4\t5\t6",
        "2\t0.01\t1\t2\t3",
    ]
    file.write_text("\r\n".join(lines), encoding="latin-1")
    markers = load_markers(file)
    np.testing.assert_allclose(markers["B"], [[0.004, 0.005, 0.006], [np.nan] * 3])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("250.00\t250.00\t5\t14", "250.00\t250.00\t5\t15"), "NumMarkers is 15"),
        (("\tmm\t", "\tfurlong\t"), 'unit="mm"'),
        (("Frame#", "Bild"), 'no line starts with "Frame#"'),
        (("175.798014", "175,798014"), "decimal comma"),
        (("175.798014", ""), "all three coordinates or none"),
        (("0.004000", "0.000000"), "repeats the stamp"),
    ],
)
def test_a_wrong_trc_is_refused_with_its_place(tmp_path, change, said):
    file = tmp_path / "wrong.trc"
    text = (OPENSIM / "dataWithNaNsOfDifferentCases.trc").read_text(encoding="utf-8")
    assert change[0] in text
    file.write_text(text.replace(*change, 1), encoding="utf-8")
    with pytest.raises(DataError, match=r"wrong\.trc") as refused:
        load_markers(file)
    assert said in str(refused.value)


NEXUS = """
Trajectories
100
,,Anna:LELB,,,Anna:LWRI,,
Frame,Sub Frame,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm
11,0,1,2,3,4,5,6
12,0,1,2,3,,,

Devices
1000
"""
QUALISYS = (
    "NO_OF_FRAMES\t2\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nDESCRIPTION\t--\n"
    "DATA_INCLUDED\t3D\nMARKER_NAMES\tLELB\tLWRI\n{columns}{rows}"
)


def test_a_nexus_export_without_its_rate_is_refused(tmp_path):
    (tmp_path / "nexus.csv").write_text(NEXUS.replace("\n100\n", "\n\n"))
    assert_refused(
        lambda: load_markers(tmp_path / "nexus.csv"),
        "expected rate, names, Frame and Sub Frame, and units after Trajectories",
    )


def test_nexus_export(tmp_path):
    file = tmp_path / "nexus.csv"
    file.write_text(NEXUS, encoding="utf-8")
    markers = load_markers(file)
    assert markers.names == ("LELB", "LWRI")
    np.testing.assert_allclose(markers.time_s, [0.10, 0.11])
    np.testing.assert_allclose(markers["LWRI"], [[0.004, 0.005, 0.006], [np.nan] * 3])


@pytest.mark.parametrize("columns", ["", "Frame\tTime\tLELB X\tLELB Y\tLELB Z\tLWRI X\tLWRI Y\tLWRI Z\n"])
def test_qualisys_export(tmp_path, columns):
    file = tmp_path / "qualisys.tsv"
    stamps = ["1\t0.00000\t", "2\t0.01000\t"] if columns else ["", ""]
    rows = f"{stamps[0]}1\t2\t3\t4\t5\t6\n{stamps[1]}1\t2\t3\t0.000\t0.000\t0.000\n"
    file.write_text(QUALISYS.format(columns=columns, rows=rows), encoding="utf-8")
    markers = load_markers(file)
    np.testing.assert_allclose(markers.time_s, [0.0, 0.01])
    np.testing.assert_allclose(markers["LWRI"], [[0.004, 0.005, 0.006], [np.nan] * 3])


def test_plain_csv_of_a_spreadsheet_with_decimal_commas_and_other_columns(tmp_path):
    file = tmp_path / "plain.csv"
    file.write_text(
        "Frame;Time (s);wrist X (mm);wrist Y (mm);wrist Z (mm)\n1;0,5;1,5;2;3\n2;0,6;;;\n", encoding="utf-8"
    )
    markers = load_markers(file)
    np.testing.assert_allclose(markers["wrist"], [[0.0015, 0.002, 0.003], [np.nan] * 3])
    np.testing.assert_allclose(markers.time_s, [0.5, 0.6])


def test_plain_csv_needs_a_unit_and_says_so(tmp_path):
    file = tmp_path / "plain.csv"
    file.write_text("time,a_x,a_y,a_z\n0,1,2,3\n", encoding="utf-8")
    assert_refused(lambda: load_markers(file), 'unit="mm"')
    np.testing.assert_allclose(load_markers(file, unit="mm")["a"], [[0.001, 0.002, 0.003]])
    assert_refused(lambda: load_markers(file, unit="inch"), "unit")


def c3d_file(file: Path, labels: list[str], units: str = "mm") -> np.ndarray:
    ezc3d = pytest.importorskip("ezc3d", reason="NOT RUN: the extra oarlock[c3d] is not installed")
    content = ezc3d.c3d()
    points = np.ones((4, len(labels), 4))
    points[:3] = np.random.default_rng(0).uniform(-900, 900, (3, len(labels), 4))
    content["parameters"]["POINT"]["RATE"]["value"] = [200]
    content["parameters"]["POINT"]["LABELS"]["value"] = labels
    content["parameters"]["POINT"]["UNITS"]["value"] = [units]
    points[:3, 0, 1], points[:3, 1, 2] = np.nan, 0.0
    content["data"]["points"] = points
    content.write(str(file))
    return points[:3].transpose(2, 1, 0)


def test_a_damaged_c3d_file_that_would_end_its_reader_is_refused(tmp_path):
    whole, file = tmp_path / "whole.c3d", tmp_path / "damaged.c3d"
    c3d_file(whole, ["Bob:A", "Bob:B", "*12"])
    content = bytearray(whole.read_bytes())
    # Found by fuzzing: a segmentation fault in ezc3d 1.7.2.
    for place, byte in ((39, 97), (254, 167), (807, 185)):
        content[place] = byte
    file.write_bytes(content)
    assert_refused(lambda: load_markers(file), "damaged")


@pytest.mark.parametrize(("units", "metres"), [("mm", 1e-3), ("m", 1.0)])
def test_c3d_with_prefixes_units_and_missing_points(tmp_path, units, metres):
    given = c3d_file(tmp_path / "trial.c3d", ["Bob:A", "Bob:B", "*12"], units)
    markers = load_markers(tmp_path / "trial.c3d")
    assert markers.names == ("A", "B", "*12")
    assert markers.rate_hz == pytest.approx(200.0)
    unseen = np.zeros((4, 3), dtype=bool)
    unseen[1, 0] = unseen[2, 1] = True
    np.testing.assert_array_equal(markers.seen, ~unseen)
    np.testing.assert_allclose(
        markers.position_m[~unseen], given[~unseen] * metres, atol=SINGLE_PRECISION_M * max(1, 1e3 * metres)
    )
    assert load_markers(tmp_path / "trial.c3d", names=["Bob:B"]).names == ("Bob:B",)
    assert load_markers(tmp_path / "trial.c3d", names={"B": "wrist"}).names == ("wrist",)


def test_two_subjects_keep_their_prefixes(tmp_path):
    c3d_file(tmp_path / "trial.c3d", ["Bob:A", "Eve:A"])
    assert load_markers(tmp_path / "trial.c3d").names == ("Bob:A", "Eve:A")


def test_a_damaged_c3d_is_a_data_error(tmp_path):
    pytest.importorskip("ezc3d", reason="NOT RUN: the extra oarlock[c3d] is not installed")
    (tmp_path / "no.c3d").write_bytes(b"\x02\x50nothing")
    assert_refused(lambda: load_markers(tmp_path / "no.c3d"), "no.c3d")


def test_without_ezc3d_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    (tmp_path / "trial.c3d").write_bytes(b"\x02\x50")
    assert_refused(lambda: load_markers(tmp_path / "trial.c3d"), "oarlock[c3d]")


def test_axes_turn_points_and_refuse_mirrors():
    markers = small()
    turned = markers.turned("y-up-from-z-up")
    np.testing.assert_array_equal(turned["LELB"][:, 1], markers["LELB"][:, 2])
    assert_same(turned.turned("z-up-from-y-up"), markers)
    assert_refused(lambda: markers.turned(np.diag([1.0, 1.0, -1.0])), "no rotation")
    assert_refused(lambda: markers.turned("y-up"), "y-up-from-z-up")


def test_markers_refuse_what_they_cannot_mean():
    assert_refused(lambda: Markers(("a", "a"), [0.0], np.zeros((1, 2, 3))), "names are unique")
    assert_refused(lambda: Markers(("a",), [0.0, 1.0], np.zeros((1, 1, 3))), "rows")
    assert_refused(lambda: Markers(("a",), [0.0], np.full((1, 1, 3), np.inf)), "infinite")
    assert_refused(lambda: small().select(["LELBO"]), "LELB")
    assert small().between(0.01, 0.02).time_s.tolist() == [0.01, 0.02]


@pytest.mark.data
@pytest.mark.parametrize(
    ("file", "markers", "frames", "missing"),
    [
        ("OpenSim/Tests/shared/walking2.c3d", 44, 1249, 27567),
        ("OpenSim/Tests/shared/walking5.c3d", 40, 1103, 20082),
        ("OpenSim/Sandbox/MatlabScripts/test_walking.c3d", 40, 806, 10455),
        ("OpenSim/Common/Test/dataWithBlanksForMissingMarkers.trc", 40, 464, None),
        ("OpenSim/Common/Test/dataWithNaNsWithSpaces.trc", 42, 427, None),
        ("OpenSim/Tests/shared/gait10dof18musc_walk_CRLF_line_ending.trc", 41, 10, 0),
        ("Bindings/Java/Matlab/examples/testData/Subject01/MarkerData/walk_free_01.trc", 41, 73, 0),
        ("Applications/IK/tests/resources/subject01_synthetic_marker_data.trc", 31, 73, 0),
        ("Applications/IK/tests/resources/abdbonepin.trc", 11, 1991, 0),
        ("Applications/IK/tests/resources/constraintTest.trc", 44, 2105, 0),
    ],
)
def test_real_files(file, markers, frames, missing):
    folder = local_folder("data/opensim_core")
    if file.endswith(".c3d"):
        pytest.importorskip("ezc3d", reason="NOT RUN: the extra oarlock[c3d] is not installed")
    found = load_markers(folder / file)
    assert found.position_m.shape == (frames, markers, 3)
    assert np.nanmax(np.abs(found.position_m)) < 6.0, "a laboratory's volume in m"
    gone = int((~found.seen).sum())
    assert gone > 0 if missing is None else gone == missing


@pytest.mark.data
@pytest.mark.parametrize("trial", ["walking2", "walking5"])
def test_c3d_agrees_with_the_table_that_opensim_made_of_it(trial):
    pytest.importorskip("ezc3d", reason="NOT RUN: the extra oarlock[c3d] is not installed")
    folder = local_folder("data/opensim_core/OpenSim")
    markers = load_markers(folder / f"Tests/shared/{trial}.c3d")
    table = load_markers(folder / f"Common/Test/std_{trial}_markers.trc")
    rows = np.searchsorted(markers.time_s, table.time_s - 1e-6)
    np.testing.assert_allclose(markers.time_s[rows], table.time_s, atol=1e-9)
    assert markers.names == table.names
    np.testing.assert_allclose(markers.position_m[rows], table.position_m, rtol=0, atol=PRINTED_M)
