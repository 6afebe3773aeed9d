"""Estimators side by side: the whole tree is ahead where its model holds, and the table says so honestly."""

import csv
import json
import math
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock import Config, DataError, Recording
from oarlock.evaluation.comparison.comparison import Comparison
from oarlock.evaluation.comparison.estimators import estimator, estimators, usual_estimators
from oarlock.evaluation.comparison.filter_names import TREE_FILTERS
from oarlock.evaluation.comparison.scores import best
from oarlock.rowing.simulation.experiment import simulate_sculling
from refusals import assert_refused

BUILT_IN = ("ukf", "limbs", "limbs_open", "vector_kf")
"""One of each family that needs no other package."""


@pytest.fixture(scope="module")
def rowed(sculler: oarlock.Model) -> tuple[oarlock.Track, Recording]:
    return simulate_sculling(sculler, "B-B", duration_s=4.0, seed=31)


@pytest.fixture(scope="module")
def compared(sculler: oarlock.Model, rowed: tuple[oarlock.Track, Recording]) -> Comparison:
    return oarlock.studies.compare(sculler, rowed[1], rowed[0], BUILT_IN)


@pytest.mark.parametrize("seed", [41, pytest.param(42, marks=pytest.mark.long)])
def test_the_tree_is_ahead_of_limbs_and_single_units(sculler, seed):
    """Boat surging and biased sensors; seeds that nothing was tuned to."""
    truth, recording = simulate_sculling(sculler, "B-B", duration_s=8.0, rate_spm=(20.0, 34.0), seed=seed)
    found = oarlock.studies.compare(sculler, recording, truth, BUILT_IN)
    tree = found["ukf"]
    assert tree.mean_rmse_deg < found["limbs"].mean_rmse_deg
    assert tree.mean_rmse_deg < found["limbs_open"].mean_rmse_deg
    # units that know nothing of each other take the boat's surge for tilt: degrees against hundredths
    assert 20 * tree.mean_rmse_deg < found["vector_kf"].mean_rmse_deg
    for landmark in ("shoulder", "elbow", "wrist"):
        least = min(found.scores, key=lambda row: row.positions_rmse_m[landmark])
        assert least.name == "ukf"
    assert 0.3 < tree.nees < 2.0
    assert "ukf" in found.wins["mean_rmse_deg"]


def test_filters_on_single_units_are_ahead_of_nothing_but_say_nothing(compared):
    units = compared["vector_kf"]
    assert math.isnan(units.nees)
    assert math.isnan(units.coverage)
    assert units.kinematics_us > 0
    assert math.isnan(compared["ukf"].kinematics_us)
    assert compared["ukf"].coverage > 0.8


def test_angles_are_those_that_units_feel(compared):
    assert len(compared.joints) == 11  # Table 5 of the source
    assert not any("hand" in joint or "oar" in joint for joint in compared.joints)
    assert {row.joints for row in compared.scores} == {11}


def test_every_estimator_has_a_title_a_source_and_assumptions():
    found = estimators()
    assert len({e.name for e in found}) == len(found)
    assert all(e.title and e.source and e.assumes for e in found)
    assert {e.name for e in usual_estimators()} <= {e.name for e in found}


def test_the_page_names_all_of_them():
    page = (Path(__file__).parents[1] / "docs/compare.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)`", page))
    assert {e.name for e in usual_estimators()} <= named


def test_an_estimator_of_ones_own(sculler, rowed):
    config = Config(structure="tree", filter="ekf", estimate=("gyro_bias",))
    own = replace(estimator("ekf"), name="mine", config=config)
    found = oarlock.studies.compare(sculler, rowed[1], rowed[0], [own, "ekf"])
    assert found["mine"].mean_rmse_deg > found["ekf"].mean_rmse_deg


def test_a_calibration_reaches_all_of_them(sculler, rowed):
    """Lengths and a mount that are wrong show in every family."""
    mount = next(s.mount for s in sculler.describe().sensors if s.name == "r_forearm")
    turned = np.asarray(mount.rotation) @ Rotation.from_rotvec([0.0, 0.2, 0.0]).as_matrix()
    worn = oarlock.Calibration({"l_ua_r": 0.30}, {"r_forearm": (turned, mount.offset)})
    names = ["ekf", "limbs_open", "vector_kf"]
    told = oarlock.studies.compare(sculler, rowed[1], rowed[0], names, calibration=worn)
    for row in told.scores:
        assert row.evaluation["r_elbow_rotation"].rmse > np.radians(3.0)


def test_the_engine_says_which_trees_there_are():
    assert {"ukf", "ekf"} <= set(TREE_FILTERS)
    for name in TREE_FILTERS:
        assert Config(filter=name).filter == name
        assert estimator(name + "_open").config.closures is False
        assert estimator(name + "_open").config.structure == "tree"
        assert estimator(name + "_plain").config.estimate == []
        assert estimator(name).live


def test_live_steps_are_refused_where_there_are_none(sculler):
    assert estimator("ekf").tracker(sculler).state_names
    for name in ("limbs", "vqf", "vector_kf"):
        with pytest.raises(DataError, match=r"cannot step live.*ukf"):
            estimator(name).tracker(sculler)
    with pytest.raises(DataError):
        Config(filter="vqf")


def test_an_unknown_estimator_names_the_nearest(sculler, rowed):
    assert_refused(lambda: oarlock.studies.compare(sculler, rowed[1], rowed[0], ["limbs_opn"]), "limbs_open")


def test_what_cannot_run_is_left_out_unless_it_was_asked_for(monkeypatch):
    for package in ("vqf", "ahrs"):
        monkeypatch.setitem(sys.modules, package, None)
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 4.0, 81)
    motion = oarlock.simulation.Motion(
        tuple(model.joint_names), time_s, 0.3 * np.sin(3.0 * time_s[:, None] + np.arange(3.0))
    )
    truth, recording = oarlock.simulate(model, motion, seed=1)
    found = oarlock.studies.compare(model, recording, truth, start_s=1.0)
    assert "oarlock[compare]" in found.left_out["vqf"]
    assert "one chain" in found.left_out["limbs"]
    assert {"ukf", "vector_kf"} <= {row.name for row in found.scores}
    # every joint of a pendulum carries a unit
    assert found.joints == tuple(model.joint_names)
    assert_refused(
        lambda: oarlock.studies.compare(model, recording, truth, ["ukf", "vqf"]), "oarlock[compare]"
    )
    with pytest.raises(KeyError, match="left out"):
        found["vqf"]


def test_without_truth_all_are_held_against_the_first(sculler, rowed):
    found = oarlock.studies.compare(sculler, rowed[1], None, ["ekf", "ukf"])
    assert found.reference == "ekf"
    assert found["ekf"].mean_rmse_deg == 0.0
    assert 0.0 < found["ukf"].mean_rmse_deg < 0.1


def test_what_is_best_depends_on_the_column():
    assert best("mean_rmse_deg", {"a": 1.0, "b": 1.01, "c": 1.1, "d": math.nan}) == ("a", "b")
    assert best("steps_per_s", {"a": 100.0, "b": 1000.0}) == ("b",)
    assert best("nees_per_state", {"a": 0.5, "b": 1.8, "c": 40.0}) == ("b",)
    assert best("coverage_95", {"a": 1.0, "b": 0.94}) == ("b",)
    assert best("correlation", {"a": 0.9, "b": 0.99}) == ("b",)
    assert best("nees_per_state", {"a": math.nan}) == ()


@pytest.fixture(scope="module")
def trial(rowed: tuple[oarlock.Track, Recording], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compare")
    rowed[1].save(folder / "trial")
    rowed[0].save(folder / "trial/truth")
    return folder


def test_the_verb_writes_table_and_page(trial):
    out = trial / "compared"
    asked = [part for name in BUILT_IN for part in ("--filter", name)]
    done = run("lab", "compare", trial / "trial", "--model", "sculler", *asked, "--out", out)
    for name in BUILT_IN:
        assert re.search(rf"^  {name} ", done.stdout, re.M)
    document = tomllib.loads((out / "compare.toml").read_text(encoding="utf-8"))
    assert [row["filter"] for row in document["estimators"]] == list(BUILT_IN)
    assert document["reference"] == "truth"
    with open(out / "compare.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["mean_rmse_deg"]) < float(rows[3]["mean_rmse_deg"])
    assert rows[3]["nees_per_state"] == ""
    page = (out / "compare.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert not re.search(r"""(?:src|href)=["']?(?:https?:)?//""", page)
    assert page.count("<circle") == len(BUILT_IN)


def test_the_verb_speaks_json_and_leaves_the_page_out(trial):
    out = trial / "compared_json"
    asked = ("--model", "sculler", "--filter", "ekf", "--filter", "vector_kf", "--no-html", "--json")
    done = run("lab", "compare", trial / "trial", trial / "trial/truth", *asked, "--out", out)
    document = json.loads(done.stdout)
    assert document["wins"]["mean_rmse_deg"] == ["ekf"]
    assert document["estimators"][1]["nees_per_state"] is None
    assert not (out / "compare.html").exists()


def test_the_verb_refuses_what_it_does_not_know(trial):
    asked = ("--model", "sculler", "--filter", "ukff", "--out", trial / "no")
    done = run("lab", "compare", trial / "trial", *asked, status=2)
    assert "ukf" in done.stderr


def test_track_takes_the_same_names(trial):
    from_trial = ("track", trial / "trial", "--model", "sculler")
    run(*from_trial, "--filter", "vector_kf", "--csv", "--out", trial / "units")
    assert (trial / "units/report.html").exists()
    run("evaluate", trial / "units", trial / "trial")
    run(*from_trial, "--filter", "limbs", "--out", trial / "limbs")
    done = run(*from_trial, "--filter", "vqf", "--smooth", "--out", trial / "no", status=2)
    assert "--smooth" in done.stderr
    run(*from_trial, "--filter", "nope", "--out", trial / "no", status=2)
