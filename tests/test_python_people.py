"""What people at a prompt or in a notebook use: names of joints, tables, curves, pages of objects, progress."""

import copy
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import oarlock
from oarlock import DataError
from oarlock.storage import progress as shared
from oarlock.storage.notebook_html import html_table
from oarlock.tracking.joint_series import HingeSeries, SlideSeries
from oarlock.tracking.settings import meanings


@pytest.fixture(scope="module")
def trial():
    from oarlock import rowing

    model = oarlock.load_model("sculler")
    truth, recording = oarlock.simulate(model, rowing.sculling(model, duration_s=2.0), seed=1)
    return model, truth, recording


@pytest.fixture(scope="module")
def track(trial):
    return oarlock.track(trial[0], trial[2])


# --- joints -------------------------------------------------------------------------------------------


def test_a_track_is_a_mapping_of_joints(track):
    assert "seat" in track and "sea" not in track and 5 not in track
    assert list(track) == list(track.keys()) == list(track.joint_names) and len(track) == len(
        track.joint_names
    )
    assert {name: series.name for name, series in track.items()} == {name: name for name in track}
    with pytest.raises(TypeError, match=r"by name and parts by time.*track\[1\.0:2\.0\]"):
        track[5]
    assert hash(track) == hash(track) and track == track and track != track.with_notes("another")


@pytest.mark.parametrize("is_smooth", [False, True])
def test_a_part_of_a_track_has_the_rows_of_its_time(trial, is_smooth):
    whole = oarlock.track(trial[0], trial[2], smooth=is_smooth)
    part = whole[0.5:1.25]
    rows = (whole.time_s >= 0.5) & (whole.time_s <= 1.25)
    for name in ("time_s", "q", "qd", "q_std", "observed"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])
    assert np.array_equal(part.info.nis, whole.info.nis[rows], equal_nan=True)
    assert part.slow.keys() == whole.slow.keys()
    assert all(len(series.value) == rows.sum() for series in part.slow.values())
    assert part.beliefs.time_s.min() >= 0.5 and part.beliefs.time_s.max() <= 1.25
    assert part.smoothed is is_smooth and part.last_belief is None
    assert whole[0.5:].last_belief is whole.last_belief
    np.testing.assert_array_equal(part.frame_positions("r_wrist"), whole.frame_positions("r_wrist")[rows])
    with pytest.raises(DataError, match="no samples"):
        oarlock.smooth(oarlock.track(*trial[::2])[0.5:1.0])
    with pytest.raises(DataError, match=r"no row is between 7.* the track has 0\.008 to"):
        whole.between(7.0)
    with pytest.raises(TypeError, match="no step"):
        whole[0.5:1.0:2]


def test_settings_are_keywords(trial):
    model, _, recording = trial
    plain = oarlock.track(model, recording, config=oarlock.Config(structure="tree", filter="ekf"))
    same = oarlock.track(model, recording, structure="tree", filter="ekf")
    both = oarlock.track(model, recording, config=oarlock.Config(structure="tree"), filter="ekf")
    assert np.array_equal(plain.q, same.q) and np.array_equal(plain.q, both.q)
    smoothed = oarlock.track(model, recording, structure="tree", filter="ekf", smooth=True)
    assert smoothed.smoothed and np.array_equal(smoothed.q, oarlock.smooth(plain).q)
    assert set(meanings()) == set(oarlock.Config().to_dict())
    with pytest.raises(DataError, match="config: filtr = 'ekf': unknown field"):
        oarlock.track(model, recording, filtr="ekf")
    with pytest.raises(DataError, match="settings as keywords"):
        oarlock.track(model, recording, config={"filter": "ekf"})
    with pytest.raises(DataError, match=r'load it: oarlock\.load_model\("robot\.toml"\)'):
        oarlock.track("robot.toml", recording)


def test_errors_have_one_root(tmp_path):
    for error, own in (
        (oarlock.ModelError, ValueError),
        (DataError, ValueError),
        (oarlock.DivergedError, RuntimeError),
    ):
        assert issubclass(error, oarlock.OarlockError) and issubclass(error, own)
        assert pickle.loads(pickle.dumps(error("why"))).args == ("why",)
    with pytest.raises(oarlock.OarlockError, match="filter"):
        oarlock.Config(filter="x")
    (tmp_path / "m.toml").write_text("[[joint]]\n")
    with pytest.raises(oarlock.OarlockError, match="toml"):
        oarlock.load_model(tmp_path / "m.toml")


def test_a_state_estimate_has_names():
    model = oarlock.load_model("arm")
    recording = oarlock.simulation.simulate_session(model, seed=1).recording.slice(end_s=4.0)
    belief = oarlock.track(model, recording).last_belief
    assert list(belief) == belief.keys() == list(model.joint_names) and "elbow_flexion_r" in belief
    elbow, names = belief["elbow_flexion_r"], belief.state_names
    at, rate = names.index("elbow_flexion_r"), names.index("elbow_flexion_r.velocity")
    assert elbow.angle_rad == belief.mean[at] and elbow.velocity == belief.mean[rate]
    assert elbow.std_deg == pytest.approx(np.degrees(np.sqrt(belief.covariance[at, at])), rel=1e-12)
    assert belief["shoulder_r"].value.shape == (3,) and belief["thorax"].std.shape == (6,)
    with pytest.raises(KeyError, match="elbow_flexion_r"):
        belief["elbow_flexion"]


def test_trackers_are_copied_and_pickled(trial):
    model, _, recording = trial
    tracker = oarlock.Tracker(model)
    samples = tracker.samples(recording)
    for sample in samples[:20]:
        tracker.step(sample)
    with pytest.raises(DataError, match=r"cannot be pickled.*copy\.copy works"):
        pickle.dumps(tracker)
    early = copy.copy(tracker)
    for sample in samples[20:150]:
        tracker.step(sample)
        early.step(sample)
    pickled, deep = pickle.loads(pickle.dumps(tracker)), copy.deepcopy(tracker)
    for sample in samples[150:]:
        expected, _ = tracker.step(sample)
        for other in (early, pickled, deep):
            np.testing.assert_array_equal(other.step(sample)[0].mean, expected.mean)


def test_recordings_of_arrays_and_tables(trial):
    recording = trial[2]
    arrays = {s.name: {"time_s": s.time_s, **s.values} for s in recording}
    arrays["seat"]["unit"] = "m"
    again = oarlock.Recording.from_arrays(arrays, {"source": "arrays"})
    assert again.meta["source"] == "arrays" and again["seat"].unit == "m"
    pytest.importorskip("pandas")
    table = oarlock.Recording.from_pandas({s.name: s.to_pandas() for s in recording})
    for other in (again, table):
        assert [type(s) for s in other] == [type(s) for s in recording]
        for one, two in zip(recording, other, strict=True):
            assert one.values.keys() == two.values.keys()
            assert all(np.array_equal(one.values[k], two.values[k]) for k in one.values)
    time_s = np.arange(3.0)
    place = oarlock.Recording.from_arrays({"hand": {"time_s": time_s, "value": np.zeros((3, 3))}})["hand"]
    assert isinstance(place, oarlock.recording.VectorStream)
    for fields, words in (
        ({"value": time_s}, "has no time_s"),
        ({"time_s": time_s, "gyro": np.zeros((3, 3))}, "gyro_rad_s"),
        ({"time_s": time_s}, "no sensor has the fields of none"),
        ({"time_s": time_s, "value": time_s, "gyro_rad_s": np.zeros((3, 3))}, "Give those of one sensor"),
    ):
        with pytest.raises(DataError, match=words):
            oarlock.Recording.from_arrays({"back": fields})
    frame = pytest.importorskip("pandas").DataFrame({"time_s": time_s, "gyro_": time_s, 7: time_s})
    with pytest.raises(DataError, match="no sensor has the fields 7, gyro_"):
        oarlock.Recording.from_pandas({"back": frame})


def test_rooms_are_at_hand_after_the_import():
    for room in ("rowing", "report", "formats", "season", "movement", "live", "calibration"):
        assert getattr(oarlock, room).__name__ == f"oarlock.{room}"


def test_a_result_in_a_console_is_short(track):
    for result in (
        track,
        track["seat"],
        track.info,
        track.beliefs,
        track.last_belief,
        track["trunk"],
    ):
        assert len(repr(result).splitlines()) <= 10 and len(repr(result)) < 1500


def test_a_joint_is_an_attribute_and_completes(track):
    assert np.array_equal(track.r_elbow_flexion.angle_rad, track["r_elbow_flexion"].angle_rad)
    assert {"r_elbow_flexion", "seat", "plot"} <= set(dir(track))
    assert "seat" in track._ipython_key_completions_()


def test_joints_have_the_units_of_their_kind(track):
    trunk, seat = track.hinge("trunk"), track.slide("seat")
    assert (type(trunk), type(seat)) == (HingeSeries, SlideSeries)
    assert np.array_equal(trunk.angle_deg, np.degrees(trunk.angle_rad))
    assert np.array_equal(trunk.std_deg, np.degrees(trunk.std_rad))
    assert np.array_equal(seat.position_cm, 100.0 * seat.position_m)


@pytest.mark.parametrize(
    ("asked", "kind", "words"),
    [
        (lambda t: t.r_elbow_flexon, AttributeError, 'Did you mean "r_elbow_flexion"'),
        (lambda t: t.frame_postions, AttributeError, 'Did you mean "frame_positions"'),
        (lambda t: t["saet"], KeyError, "seat"),
        (lambda t: t.hinge("seat"), DataError, 'use track.slide\\("seat"\\)'),
        (lambda t: t.trunk.position_m, AttributeError, "a hinge has no 'position_m'"),
        (lambda t: t.seat.position_mm, AttributeError, 'Did you mean "position_'),
        (lambda t: t.column("trunk_velocity_rads"), DataError, 'Did you mean "trunk_velocity_rad_s"'),
    ],
)
def test_a_wrong_name_is_answered_with_the_nearest(track, asked, kind, words):
    with pytest.raises(kind, match=words):
        asked(track)


def test_copies_and_pickles_of_a_track_work(track):
    for other in (copy.copy(track), pickle.loads(pickle.dumps(track))):
        assert np.array_equal(other.trunk.angle_rad, track.trunk.angle_rad)


def test_positions_of_several_frames_are_those_of_each(track):
    both = track.positions_of(["r_wrist", "l_wrist"], relative_to="r_shoulder")
    for k, frame in enumerate(("r_wrist", "l_wrist")):
        # The last bits depend on the shape of the product.
        np.testing.assert_allclose(both[:, k], track.frame_positions(frame, "r_shoulder"), rtol=0, atol=1e-12)


# --- tables -------------------------------------------------------------------------------------------


def test_tables_of_a_track_have_its_columns(track):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    assert isinstance(track.to_pandas(), pandas.DataFrame)
    assert isinstance(track.to_polars(), polars.DataFrame)
    for table in (track.to_pandas(), track.to_polars()):
        assert list(table.columns) == list(track.columns())
        assert np.array_equal(np.asarray(table["trunk_rad"]), track.column("trunk_rad"))


def test_xarray_knows_units(track):
    pytest.importorskip("xarray")
    assert track.to_xarray()["trunk_velocity_rad_s"].attrs == {"units": "rad/s"}


def test_tables_of_streams_and_scores(trial, track):
    pytest.importorskip("pandas")
    back = trial[2]["back"]
    table = back.to_pandas()
    assert list(table.columns[:2]) == ["time_s", "gyro_rad_s_x"]
    assert np.array_equal(table["accel_m_s2_z"], back.accel_m_s2[:, 2])
    evaluation = oarlock.evaluate(track, trial[1], start_s=0.5)
    assert list(evaluation.to_pandas()["joint"]) == list(track.joint_names)


def test_an_absent_library_is_named_with_its_extra(track, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "polars", None)
    with pytest.raises(DataError, match=r"to_polars needs polars: pip install 'oarlock\[polars\]'"):
        track.to_polars()


# --- curves -------------------------------------------------------------------------------------------


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def test_a_plot_has_curve_and_band_in_degrees(track, pyplot):
    (ax,) = track.plot("trunk")
    seen = ax.lines[-1].get_ydata()
    assert np.array_equal(seen, track.hinge("trunk").angle_deg)
    path = ax.collections[0].get_paths()[0].vertices
    top = (track.trunk.angle_deg + 1.96 * track.trunk.std_deg).max()
    assert path[:, 1].max() == pytest.approx(top, rel=1e-12)  # the same sum, drawn
    assert ax.get_ylabel() == "deg"


def test_a_plot_of_all_joints_pairs_the_sides(track, pyplot):
    titles = [ax.get_title(loc="left") for ax in track.plot()]
    assert titles[:2] == ["seat", "trunk"] and titles.count("elbow flexion") == 1
    assert len(titles) <= 12


def test_a_plot_draws_into_given_axes_and_refuses_mixed_units(trial, track, pyplot):
    _, ax = pyplot.subplots()
    assert track.plot([("r_elbow_flexion", "l_elbow_flexion")], truth=trial[1], axes=[ax]) == [ax]
    with pytest.raises(DataError, match="different units"):
        track.plot([("seat", "trunk")])
    with pytest.raises(DataError, match="1 axes for 2 panels"):
        track.plot(["seat", "trunk"], axes=[ax])


def test_a_recording_is_drawn_by_quantity(trial, pyplot):
    assert len(trial[2].plot(["back", "seat"])) == 4


# --- pages of objects ---------------------------------------------------------------------------------


def test_objects_have_pages_for_notebooks(trial, track):
    model, truth, recording = trial
    pages = {
        "Track": (track, "r_elbow_flexion"),
        "Recording": (recording, "l_forearm"),
        "Model sculler": (model, "trunk lean"),
        "Evaluation": (oarlock.evaluate(track, truth, start_s=0.5), "mean RMSE"),
        "Calibration": (oarlock.Calibration(parameters={"l_b": 0.5}), "l_b"),
    }
    for title, (thing, inside) in pages.items():
        page = thing._repr_html_()
        assert page.startswith("<div") and f"<b>{title}</b>" in page and inside in page


def test_cells_are_text_not_markup():
    assert "&lt;b&gt;" in html_table(["name", "value"], [("<b>", 1.0)])


# --- progress -----------------------------------------------------------------------------------------


def test_progress_true_is_shown_and_ends(trial, capsys, monkeypatch):
    monkeypatch.setattr(shared, "FIRST_LINE_S", 1e-6)
    monkeypatch.setattr(shared, "LINES_S", 1e-6)
    track = oarlock.track(trial[0], trial[2], progress=True)
    oarlock.smooth(track, progress=True)
    oarlock.evaluate(track, trial[1], start_s=0.5, progress=True)
    said = capsys.readouterr().err
    assert all(f"{what}: " in said for what in ("tracking", "smoothing", "scoring"))


def test_progress_false_and_none_are_silent(trial, capsys, monkeypatch):
    monkeypatch.setattr(shared, "FIRST_LINE_S", 1e-6)
    oarlock.track(trial[0], trial[2], progress=False)
    oarlock.track(trial[0], trial[2], progress=None)
    assert not capsys.readouterr().err


def test_the_example_of_the_page_runs(capsys):
    text = (Path(__file__).parents[1] / "docs/python.md").read_text(encoding="utf-8")
    exec(re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)[0], {})
    assert len(capsys.readouterr().out.splitlines()) == 3
