"""What is exported beside OpenSim's model and motion, read by others: Parquet, CSV, TRC; settings, notes, refusals."""

import csv
import dataclasses
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

import oarlock
from command_line import run
from oarlock.formats.export.export import FORMATS, Export, files_of
from oarlock.formats.export.plain_names import PlainNames, plain_name
from oarlock.rowing import sculling
from oarlock.storage.folder_writer import MANIFEST
from refusals import assert_refused

SIZES = {name: set(files) for name, files in files_of().items()}
MM_ROUNDING_M = 1e-15
"""A metre times 1000 and back moves a number by its last digit at most."""


@pytest.fixture(scope="module")
def track() -> oarlock.Track:
    """A sculler for three seconds; one oar's turn is told by nothing."""
    model = oarlock.load_model("sculler")
    _, recording = oarlock.simulate(model, sculling(model, 3.0, 26.0, seed=1), seed=1, rate_hz=50.0)
    streams = [s for s in recording.streams if s.name != "r_oar_theta"]
    return oarlock.track(model, oarlock.Recording(streams))


@pytest.fixture(scope="module")
def exported(track: oarlock.Track, tmp_path_factory: pytest.TempPathFactory) -> Export:
    return oarlock.export(track, tmp_path_factory.mktemp("exported"))


def test_all_files_are_there_and_said(exported: Export) -> None:
    there, beside = {file.name for file in exported.folder.iterdir()}, {"export.toml", MANIFEST}
    assert there == set(exported.files) | beside == set().union(*SIZES.values()) | beside
    about = tomllib.loads((exported.folder / "export.toml").read_text(encoding="utf-8"))
    assert about["files"] == dict(exported.files)
    assert about["notes"] == list(exported.notes)
    assert about["settings"]["degrees"] is True
    assert about["model"] == "sculler"


@pytest.mark.parametrize("name", FORMATS)
def test_each_format_writes_its_own_files(name: str, track: oarlock.Track, tmp_path: Path) -> None:
    written = oarlock.export(track, tmp_path, [name])
    assert (
        set(written.files) == SIZES[name] == {f.name for f in tmp_path.iterdir()} - {"export.toml", MANIFEST}
    )


def test_parquet_holds_every_number_and_every_unit(track: oarlock.Track, exported: Export) -> None:
    table = parquet.read_table(exported.folder / "coordinates.parquet")
    columns = {name: values for name, values in track.columns().items() if np.isfinite(values).any()}
    assert table.column_names == list(columns)
    left_out = set(track.columns()) - set(columns)
    without_numbers = ("_velocity_", "_acceleration_", "off_axis_")
    assert left_out and all(any(kind in name for kind in without_numbers) for name in left_out)
    assert any("no velocity or acceleration of r_hand_abduction" in note for note in exported.notes)
    for name, values in columns.items():
        np.testing.assert_array_equal(table[name].to_numpy(), values)
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    expected = {
        "time_s": "s",
        "seat_m": "m",
        "seat_velocity_m_s": "m/s",
        "seat_acceleration_std_m_s2": "m/s2",
        "trunk_rad": "rad",
        "trunk_std_rad": "rad",
        "trunk_velocity_rad_s": "rad/s",
        "trunk_acceleration_rad_s2": "rad/s2",
        "trunk_observed": "1",
        "surge [m/s2]": "m/s2",
        "back.gyro_bias_x std [rad/s]": "rad/s",
    }
    assert {name: units[name] for name in expected} == expected
    about = table.schema.metadata
    assert about[b"model"] == b"sculler"
    assert about[b"axes"] == b"root"
    assert json.loads(about[b"notes"]) == list(track.notes)


def test_parquet_of_a_ball_names_units_of_quaternions_and_angles(tmp_path: Path) -> None:
    model = oarlock.load_model("broad")
    time_s = np.linspace(0, 1, 51)
    motion = oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, np.full((51, 6), 0.1))
    oarlock.export(oarlock.simulate(model, motion)[0], tmp_path, "parquet")
    schema = parquet.read_schema(tmp_path / "coordinates.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["imu_quat_w"] == "1"
    assert units["imu.x_m"] == "m"
    assert units["imu.rx_velocity_rad_s"] == "rad/s"
    assert {unit for name, unit in units.items() if "near_singular" in name} == {"1"}


def test_pandas_reads_the_same_from_csv_and_parquet(exported: Export) -> None:
    pandas = pytest.importorskip("pandas", reason="NOT RUN: pandas is absent: requirements/dev.txt")
    for name in ("coordinates", "frames"):
        text = pandas.read_csv(exported.folder / f"{name}.csv")
        table = pandas.read_parquet(exported.folder / f"{name}.parquet")
        # older pandas read text to the last digit but one
        pandas.testing.assert_frame_equal(text, table, rtol=1e-14, atol=0, check_dtype=False)


def test_csv_has_a_joint_that_nothing_observes_at_its_rest(exported: Export) -> None:
    with (exported.folder / "coordinates.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    # No sensor tells the feathering: it is at its rest, as the band says.
    assert {row["r_oar_theta_rad"] for row in rows} == {"0"}
    assert all(row["trunk_rad"] for row in rows)


def test_frames_are_frame_positions(track: oarlock.Track, exported: Export) -> None:
    table = parquet.read_table(exported.folder / "frames.parquet")
    assert track.model is not None
    for frame in track.model.frame_names:
        found = np.stack([table[f"{frame}_{axis}_m"].to_numpy() for axis in "xyz"], axis=1)
        np.testing.assert_array_equal(found, track.frame_positions(frame))


@pytest.mark.parametrize("ending", ["trc", "csv"])
def test_our_own_reader_reads_the_places(ending: str, track: oarlock.Track, exported: Export) -> None:
    markers = oarlock.markers.load_markers(exported.folder / f"frames.{ending}")
    assert track.model is not None
    assert markers.names == tuple(track.model.frame_names)
    np.testing.assert_array_equal(markers.time_s, track.time_s)
    for frame in markers.names:
        np.testing.assert_allclose(markers[frame], track.frame_positions(frame), rtol=0, atol=MM_ROUNDING_M)


def test_trc_of_a_z_up_model_turns_back(tmp_path: Path) -> None:
    model = oarlock.load_model("qmt_full_body")
    random, time_s = np.random.default_rng(3), np.linspace(0, 1, 51)
    swing = np.sin(2 * time_s)[:, None] * random.uniform(-0.5, 0.5, len(model.coordinate_names))
    truth = oarlock.simulate(model, oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, swing))[
        0
    ]
    oarlock.export(truth, tmp_path, ["trc"])
    back = oarlock.markers.load_markers(tmp_path / "frames.trc", axes="z-up-from-y-up")
    for frame in model.frame_names:
        np.testing.assert_allclose(back[frame], truth.frame_positions(frame), rtol=0, atol=1e-12)
    scores = oarlock.markers.evaluate_markers(truth, back, align_clock=False, align_frame=False, start_s=0.0)
    assert max(score.rmse_m.max() for score in scores.points.values()) < 1e-12


def test_header_of_the_motion_is_opensims_own(exported: Export) -> None:
    lines = (exported.folder / "coordinates.mot").read_text(encoding="ascii").splitlines()
    end = lines.index("endheader")
    head = lines[:end]
    assert head[:2] == ["Coordinates", "version=1"]
    assert f"nRows={len(lines) - end - 2}" in head
    assert f"nColumns={len(lines[end + 1].split(chr(9)))}" in head
    assert "inDegrees=yes" in head
    assert "Angles are in degrees." in head
    assert any(line.startswith("r_oar_theta: not observed in") for line in head)
    assert sum("=" in line for line in head) == 4, "readers take every line with = for a key"
    speeds = (exported.folder / "velocities.sto").read_text(encoding="ascii").splitlines()
    assert speeds[0] == "Speeds"


def test_values_of_the_tables_are_the_tracks(track: oarlock.Track, exported: Export) -> None:
    for file, array in (("coordinates.mot", track.q), ("velocities.sto", track.qd), ("std.sto", track.q_std)):
        labels, values = read_table(exported.folder / file)
        for name in labels[1:]:
            column = track.coordinate_names.index(name)
            factor = 1.0 if track.coordinate_units[column] == "m" else 180 / np.pi
            expected = np.where(np.isnan(array[:, column]).all(), 0.0, factor * array[:, column])
            np.testing.assert_allclose(values[:, labels.index(name)], expected, rtol=1e-15)


def read_table(file: Path) -> tuple[list[str], np.ndarray]:
    text = file.read_text(encoding="ascii").split("endheader\n")[1].splitlines()
    return text[0].split("\t"), np.array([[float(cell) for cell in line.split("\t")] for line in text[1:]])


def test_standard_deviations_of_a_ball_are_those_of_its_angles(tmp_path: Path) -> None:
    model = oarlock.load_model("sculler_ball")
    motion = sculling(oarlock.load_model("sculler"), 2.0, 26.0)
    _, recording = oarlock.simulate(oarlock.load_model("sculler"), motion, rate_hz=50.0)
    track = oarlock.track(model, recording, config=oarlock.Config(closures=False))
    oarlock.export(track, tmp_path, ["sto"], degrees=False)
    labels, values = read_table(tmp_path / "std.sto")
    columns = [labels.index(f"r_shoulder_XYZ_{axis}") for axis in "xyz"]
    np.testing.assert_allclose(values[:, columns], track["r_shoulder"].angles_std_rad("XYZ"), rtol=1e-14)


def test_what_the_track_does_not_hold_is_left_out_and_said(tmp_path: Path) -> None:
    model = oarlock.load_model("arm7")
    motion = oarlock.simulation.Motion(
        tuple(model.coordinate_names), np.linspace(0, 1, 51), np.zeros((51, 7))
    )
    truth = oarlock.simulate(model, motion)[0]
    other = dataclasses.replace(truth, q_std=np.full_like(truth.q, 0.1))
    assert "std.sto" in oarlock.export(other, tmp_path, ["sto"]).files
    written = oarlock.export(truth, tmp_path, ["sto"])
    assert list(written.files) == ["velocities.sto"]
    assert not (tmp_path / "std.sto").exists()
    assert "std.sto is not written: the track has no standard deviation." in written.notes


def test_the_same_track_gives_the_same_files(track: oarlock.Track, tmp_path: Path) -> None:
    for name in ("one", "two"):
        oarlock.export(track, tmp_path / name)
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes(), file.name


def test_a_track_without_its_model_gives_its_table_alone(track: oarlock.Track, tmp_path: Path) -> None:
    alone = dataclasses.replace(track, model=None)
    assert list(oarlock.export(alone, tmp_path, ["csv"]).files) == ["coordinates.csv", "angles.csv"]
    with pytest.raises(oarlock.DataError, match=r"mot, osim need the track's model.*csv and parquet"):
        oarlock.export(alone, tmp_path, ["csv", "mot", "osim"])


def test_refusals_name_what_is_valid(track: oarlock.Track, tmp_path: Path) -> None:
    assert_refused(lambda: oarlock.export(track, tmp_path, ["parket"]), 'Did you mean "parquet"')
    assert_refused(lambda: oarlock.export(track, tmp_path, []), "no format is given")
    assert_refused(lambda: oarlock.export(track, tmp_path, axes="z-up"), "'z-up' is not known")
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert_refused(lambda: oarlock.export(track, tmp_path / "file", ["csv"]), "cannot be written")


def test_nothing_left_to_write_is_refused(track: oarlock.Track, tmp_path: Path) -> None:
    q = track.q.copy()
    q[::2, 0], q[1::2, 1] = np.nan, np.nan
    with pytest.raises(oarlock.DataError, match="would leave no row"):
        oarlock.export(dataclasses.replace(track, q=q), tmp_path, ["mot"], missing="drop")


def test_a_folder_of_a_track_keeps_its_own_files(track: oarlock.Track, tmp_path: Path) -> None:
    track.save(tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    oarlock.export(track, tmp_path)
    assert all(file.read_bytes() == old for file, old in before.items() if file.name != MANIFEST)
    oarlock.load_track(tmp_path)


@pytest.mark.parametrize(
    ("name", "plain"), [("knie_é", "knie_e"), ("Fuß", "Fuu00df"), ("膝", "u819d"), ("a b/c", "a_b_c")]
)
def test_plain_names(name: str, plain: str) -> None:
    assert plain_name(name) == plain


def test_plain_names_are_given_once() -> None:
    names = PlainNames(["ground"])
    given = [names.give(n) for n in ("ground", "é", "e", "e", "e_2")]
    assert given == ["ground_2", "e", "e_2", "e_3", "e_2_2"]


# --- typed --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saved(track: oarlock.Track, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved") / "out"
    track.save(folder)
    return folder


def test_typed(saved: Path, tmp_path: Path) -> None:
    done = run("export", saved, "--out", tmp_path / "x", "--format", "mot,osim", "-f", "csv", "--json")
    document = json.loads(done.stdout)
    assert list(document["files"]) == [
        "coordinates.mot",
        "model.osim",
        "coordinates.csv",
        "angles.csv",
        "frames.csv",
    ]
    assert document["body_names"]["r_wrist"] == "r_wrist"
    again = run("export", saved, "--out", tmp_path / "x", "--radians", "--axes", "root", "--force")
    assert "Wrote" in again.stdout
    assert "inDegrees=no" in (tmp_path / "x/coordinates.mot").read_text(encoding="ascii")


def test_typed_wrongly(saved: Path, tmp_path: Path) -> None:
    for flags in (("--format", "xlsx"), ("--format", "none"), ("--axes", "z-up"), ("--missing", "fill")):
        refused = run("export", saved, "--out", tmp_path / "x", *flags, status=2)
        assert flags[0] in refused.stderr
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").write_text("", encoding="utf-8")
    run("export", saved, "--out", tmp_path / "full", status=2)
    run("export", tmp_path / "nothing", "--out", tmp_path / "x", status=1)


def test_help_says_what_every_file_holds() -> None:
    shown = run("export", "--help").stdout
    for files in files_of().values():
        for file in files:
            assert f"  {file} " in shown
    assert all(word in shown for word in ("mm", "deg", "rad", "R = Rx Ry Rz", "Y up", "placeholders"))
    assert "Usage: oarlock export" in shown and "oarlock export" in shown.partition("Examples:")[2]
