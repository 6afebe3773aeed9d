"""`oarlock lab bench`: figures that can be, from a short run; other software gives the same estimates."""

import json
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from command_line import run
from exact_recording import Floats
from oarlock_lab.bench import measure, with_biorbd
from oarlock_lab.bench.plain_kinematics import PlainKinematics
from oarlock_lab.bench.problem import WARM, BenchProblem, sculling
from oarlock_lab.bench.unscented import filterpy_run, jax_run, numpy_run

# Closures of 2 mm beside accelerations make covariances whose condition takes half the digits, and the textbook's form
# cancels. filterpy inverts the innovations' covariance, which takes some more.
SAME_FILTER_SIGMA = 1e-6
# Readings up to some tens of m/s2 and uT.
SAME_READINGS = 1e-9
# biorbd's filter lags by about 0.05 s behind swings of up to 1 rad/s.
FOLLOWS_RAD = 0.1


@pytest.fixture(scope="module")
def problem() -> BenchProblem:
    return sculling(2.0)


@pytest.fixture(scope="module")
def ours(problem: BenchProblem) -> tuple[Floats, Floats]:
    """Means and standard deviations of Oarlock's filter behind the warm samples."""
    tracker, _, _ = problem.started()
    beliefs = [tracker.step(sample)[0] for sample in tracker.samples(problem.recording)[WARM:]]
    means = np.array([belief.mean for belief in beliefs])
    return means, np.array([np.sqrt(np.diag(belief.covariance)) for belief in beliefs])


@pytest.fixture(scope="module", autouse=True)
def measured_once() -> Iterator[None]:
    """Runs that ask for the same time show one measurement."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measure, "measure", cache(measure.measure))
        yield


@pytest.fixture(scope="module")
def measured() -> dict:
    return json.loads(run("lab", "bench", "--json", "--duration-s", "0.05").stdout)


def test_json_has_its_keys(measured):
    keys = "ukf_steps_s ekf_steps_s ukf_ratio_to_textbook ekf_ratio_to_textbook textbook_us"
    keys += " p50_us p99_us p99_9_us n m"
    assert set(keys.split()) <= set(measured)
    assert set(keys.split()) <= set(measured["with_biases"])
    assert (measured["n"], measured["m"]) == (41, 58)
    assert (measured["with_biases"]["n"], measured["with_biases"]["m"]) == (72, 58)


def test_figures_fit_together(measured):
    for part in (measured, measured["with_biases"]):
        for name in ("ukf", "ekf", "factorised"):
            assert part[f"{name}_steps_s"] == pytest.approx(1e6 / part[f"{name}_us"])
            assert part[f"{name}_ratio_to_textbook"] == pytest.approx(
                part["textbook_us"] / part[f"{name}_us"]
            )
            assert 0.0 < part[f"{name}_us_p10"] <= part[f"{name}_us"]
            tenth = part["textbook_us_p10"] / part[f"{name}_us_p10"]
            assert part[f"{name}_ratio_to_textbook_p10"] == pytest.approx(tenth)
        assert part["textbook_us_p10"] <= part["textbook_us"]
        assert 0.0 < part["p50_us"] <= part["p99_us"] <= part["p99_9_us"]
        assert part["smooth_us"] > 0.0 and part["track_us"] > 0.0
        assert part["bare_ukf_ratio_to_textbook"] == pytest.approx(part["textbook_us"] / part["bare_ukf_us"])
    body = measured["full_body"]
    assert body["units"] == 16
    assert body["times_real_time"] == pytest.approx(1e4 / body["step_us"])
    assert body["start_times_real_time"] == pytest.approx(1e4 / body["start_us"])
    assert measured["times_real_time"] == pytest.approx(measured["ukf_steps_s"] / 125.0)
    assert measured["paper"]["steps_s"] == 116.0


def test_other_software_is_measured_or_named_as_missing(measured):
    assert not measured["failed"]
    found = {other["package"] for other in measured["others"]}
    assert found | set(measured["missing"]) == {"numpy", "jax", "filterpy", "biorbd"}
    assert "numpy" in found
    assert all(other["steps_s"] > 0.0 for other in measured["others"])
    assert (measured["install"] is None) == (not measured["missing"])


def test_text_names_the_filters_and_the_paper():
    shown = run("lab", "bench", "--duration-s", "0.05")
    for word in ("ukf", "ekf", "textbook", "p99.9", "the paper", "Two threads", "times faster"):
        assert word in shown.stdout


def test_help_names_every_key(measured):
    shown = run("lab", "bench", "--help").stdout
    filters = tuple(
        f"{name}_{what}" for name in ("ekf", "factorised", "bare_ukf") for what in ("us", "ratio")
    )
    missing = [key for key in measured if key not in shown and not key.startswith(filters)]
    assert missing == ["live_steps"] or not missing


def test_seconds_must_be_a_time():
    refused = run("lab", "bench", "--duration-s", "0", status=2)
    assert "20" in refused.stderr


def test_plain_kinematics_read_what_the_engine_reads(problem):
    model = problem.model
    joints = model.coordinate_names
    states = [*joints, *(f"{j}.velocity" for j in joints), *(f"{j}.acceleration" for j in joints)]
    plain = PlainKinematics(problem.described, states)
    random = np.random.default_rng(3)
    q, qd, qdd = (scale * random.uniform(-1, 1, (20, len(joints))) for scale in (0.8, 3.0, 20.0))
    found = plain.measure(np.hstack([q, qd, qdd]), np.zeros(len(joints)))
    assert np.abs(found - model.predict_measurements(q, qd, qdd)).max() < SAME_READINGS


@pytest.mark.parametrize(
    ("package", "make"), [("numpy", numpy_run), ("jax", jax_run), ("filterpy", filterpy_run)]
)
def test_other_software_runs_the_same_filter(problem, ours, package, make):
    pytest.importorskip(package, reason=f"{package} is not installed: pip install 'oarlock-lab[bench]'")
    means, stds = ours
    found = make(problem)()
    gaps = np.abs(found - means[: len(found)]) / stds[: len(found)]
    print(f"{package}: {gaps.max():.1e} sigma over {len(found)} steps")
    assert len(found) > 0
    assert gaps.max() < SAME_FILTER_SIGMA


def test_biorbd_follows_the_angles_that_its_orientations_were_made_of(problem):
    pytest.importorskip("biorbd", reason="biorbd is not installed: pip install 'oarlock-lab[bench]'")
    gaps = np.abs(with_biorbd.make(problem)() - with_biorbd.angles_rad(problem))
    assert gaps[WARM:].max() < FOLLOWS_RAD
