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
