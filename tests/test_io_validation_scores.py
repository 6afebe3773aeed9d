"""The rules of validation/ on orientations whose errors are known."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oarlock import Recording, load_model
from oarlock.evaluation.reference import Reference
from oarlock.recording import ImuStream
from oarlock_lab.validation import chains, page, qmt, singular
from oarlock_lab.validation.__main__ import main as run_validation
from oarlock_lab.validation.chains import Link, world_from_links
from oarlock_lab.validation.estimate import Missing, NotRunError, OrientationEstimate, attempt
from oarlock_lab.validation.limits import delay_s, limits
from oarlock_lab.validation.results import Collected, SetResult
from oarlock_lab.validation.rotations import about_vertical, at, quat_wxyz, rotation, twist_rad
from oarlock_lab.validation.scores import (
    attitude_error_rad,
    circular_mean_rad,
    heading_zeroed,
    hinge_error_rad,
    later,
    median_deg,
    relative_error_rad,
    rmse_deg,
)
from oarlock_lab.validation.worst_window import worst_plot, worst_window
from opensim_reader import opensim

# Rotations go through quaternions of double precision a few times.
ROUNDING_RAD = 1e-9
# OpenSim stops at an accuracy of 1e-4 rad.
SOLVED_DEG = 0.05

RATE_HZ = 50.0
TIME_S = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
PAIR = ("a", "b")
ALL = np.ones(len(TIME_S), dtype=bool)


def turns(seed, time_s=TIME_S):
    """A smooth, rich course of orientations."""
    random = np.random.default_rng(seed)
    phases, speeds = random.uniform(0, 2 * math.pi, (3, 1)), random.uniform(0.6, 2.0, (3, 1))
    angles = 0.9 * np.sin(speeds * time_s + phases)
    return Rotation.from_euler("zyx", angles.T)


def reference(time_s=TIME_S, **more):
    quats = {"a": quat_wxyz(turns(1, time_s)), "b": quat_wxyz(turns(2, time_s))}
    return Reference("made", time_s, quats, **more)


def estimate(a=None, b=None, time_s=TIME_S):
    one = Rotation.identity()
    quats = {"a": quat_wxyz((a or one) * turns(1, time_s)), "b": quat_wxyz((b or one) * turns(2, time_s))}
    return OrientationEstimate("made", time_s, quats)


def test_a_perfect_estimate_has_no_error():
    assert relative_error_rad(estimate(), reference(), PAIR).max() < ROUNDING_RAD
    assert np.abs(hinge_error_rad(estimate(), reference(), PAIR, "y")).max() < ROUNDING_RAD
    for part in attitude_error_rad(estimate(), reference(), "a"):
        assert np.abs(part).max() < ROUNDING_RAD


def test_a_common_turn_of_the_world_is_no_relative_error():
    world = Rotation.from_euler("zyx", [0.7, -0.2, 0.4])
    assert relative_error_rad(estimate(world, world), reference(), PAIR).max() < ROUNDING_RAD


def test_a_relative_heading_is_an_error_until_it_is_set():
    askew = estimate(b=about_vertical(0.3))
    assert relative_error_rad(askew, reference(), PAIR) == pytest.approx(0.3, abs=ROUNDING_RAD)
    mended = heading_zeroed(askew, reference(), at_s=1.0)
    assert relative_error_rad(mended, reference(), PAIR).max() < ROUNDING_RAD
    assert "heading set by the reference at 1 s" in mended.note


def test_one_heading_for_all_bodies_leaves_the_error_between_them():
    askew = estimate(about_vertical(0.5), about_vertical(0.8))
    mended = heading_zeroed(askew, reference(), at_s=1.0, leader="a")
    assert relative_error_rad(mended, reference(), PAIR) == pytest.approx(0.3, abs=ROUNDING_RAD)
    attitude = attitude_error_rad(mended, reference(), "a")[2]
    assert attitude.max() < ROUNDING_RAD


def test_a_constant_heading_is_removed_and_a_tilt_is_not():
    tilt = 0.05
    askew = estimate(about_vertical(2.0) * Rotation.from_euler("x", tilt))
    inclination, heading, total = attitude_error_rad(askew, reference(), "a")
    assert inclination == pytest.approx(tilt, abs=ROUNDING_RAD)
    assert np.abs(heading).max() < ROUNDING_RAD
    assert total == pytest.approx(tilt, abs=ROUNDING_RAD)


def test_the_mean_heading_is_that_of_the_scored_samples():
    moving = TIME_S > 10.0
    drift = np.where(moving, 0.2, -0.4)
    quats = {"a": quat_wxyz(about_vertical(drift) * turns(1)), "b": quat_wxyz(turns(2))}
    _, heading, _ = attitude_error_rad(
        OrientationEstimate("made", TIME_S, quats), reference(scored=moving), "a"
    )
    assert np.abs(heading[moving]).max() < ROUNDING_RAD
    assert heading[~moving] == pytest.approx(-0.6, abs=ROUNDING_RAD)


def test_a_hinge_angle_is_the_twist_about_its_axis():
    angle = 0.8 * np.sin(TIME_S)
    first = turns(1)
    second = first * Rotation.from_rotvec(angle[:, None] * [0.0, 1.0, 0.0])
    true = Reference("made", TIME_S, {"a": quat_wxyz(first), "b": quat_wxyz(second)})
    more = first * Rotation.from_rotvec((angle + 0.1)[:, None] * [0.0, 1.0, 0.0])
    found = OrientationEstimate("made", TIME_S, {"a": quat_wxyz(first), "b": quat_wxyz(more)})
    assert hinge_error_rad(found, true, PAIR, "y") == pytest.approx(0.1, abs=ROUNDING_RAD)
    assert np.abs(hinge_error_rad(found, true, PAIR, "x")).max() < ROUNDING_RAD


def test_hinge_errors_do_not_jump_at_half_a_turn():
    first = Rotation.identity(len(TIME_S))
    true = Reference(
        "made", TIME_S, {"a": quat_wxyz(first), "b": np.tile([0.0, 0.0, 0.0, 1.0], (len(TIME_S), 1))}
    )
    beyond = Rotation.from_rotvec(np.tile([0.0, 0.0, math.pi + 0.02], (len(TIME_S), 1)))
    found = OrientationEstimate("made", TIME_S, {"a": quat_wxyz(first), "b": quat_wxyz(beyond)})
    assert hinge_error_rad(found, true, PAIR, "z") == pytest.approx(0.02, abs=ROUNDING_RAD)


def test_gaps_and_what_lies_outside_are_left_out():
    quats = {k: np.array(v) for k, v in reference().quat_wxyz.items()}
    quats["a"][100:200] = np.nan
    gappy = Reference("made", TIME_S, quats)
    error = relative_error_rad(estimate(time_s=TIME_S[:900]), gappy, PAIR)
    assert np.isnan(error[100:200]).all() and np.isnan(error[900:]).all()
    assert np.isfinite(error[:100]).all() and np.isfinite(error[200:900]).all()
    assert rmse_deg(error, ALL) < math.degrees(ROUNDING_RAD)
    assert math.isnan(rmse_deg(error, TIME_S > 19.0))


def test_root_mean_square_and_median():
    error = np.radians([3.0, -4.0, np.nan, 100.0])
    kept = np.array([True, True, True, False])
    assert rmse_deg(error, kept) == pytest.approx(math.sqrt(12.5))
    assert median_deg(error, kept) == pytest.approx(3.5)


def test_orientations_between_samples():
    quats = quat_wxyz(about_vertical(np.array([0.0, 0.2, 0.4])))
    found, good = at(np.array([0.0, 1.0, 2.0]), quats, np.array([-0.1, 0.5, 2.0, 2.1]))
    assert good.tolist() == [False, True, True, False]
    assert twist_rad(found, "z")[1:3] == pytest.approx([0.1, 0.4])
    quats[1] = np.nan
    good = at(np.array([0.0, 1.0, 2.0]), quats, np.array([0.0, 0.5, 1.5, 2.0]))[1]
    assert good.tolist() == [True, False, False, True]


def test_mean_of_angles_on_either_side_of_half_a_turn():
    mean = circular_mean_rad(np.array([math.pi - 0.1, -math.pi + 0.1]))
    assert abs(mean) == pytest.approx(math.pi)


def recorded(rate_hz=100.0):
    """What gyroscopes on both bodies read, and the finely known truth."""
    time_s = np.arange(0.0, 20.0, 1.0 / rate_hz)
    step = 1e-5
    streams = []
    for seed, body in ((1, "a"), (2, "b")):
        around = turns(seed, time_s - step).inv() * turns(seed, time_s + step)
        gyro = around.as_rotvec() / (2 * step)
        streams.append(ImuStream(body, time_s, gyro_rad_s=gyro + np.array([0.01, -0.02, 0.005])))
    return Recording(streams)


# Differences over two steps of the reference and trapezoids of the gyroscope are exact to the second order in the step.
LAG_BOUND_S = 2e-4
TURN_BOUND_RAD = 1e-3


def test_lag_and_turns_of_a_reference_are_found_and_removed():
    lag_s = 0.037
    askew = {
        "a": Rotation.from_euler("xyz", [0.03, -0.02, 0.05]),
        "b": Rotation.from_euler("xyz", [-0.04, 0.0, 0.02]),
    }
    quats = {
        body: quat_wxyz(turns(seed, TIME_S - lag_s) * askew[body].inv())
        for seed, body in ((1, "a"), (2, "b"))
    }
    given = Reference("made", TIME_S, quats)
    found = limits(recorded(), given)
    assert found.lag_s == pytest.approx(lag_s, abs=LAG_BOUND_S)
    for body, turn in askew.items():
        assert (found.turns[body].inv() * turn).magnitude() < TURN_BOUND_RAD
    exact = estimate(time_s=recorded()["a"].time_s)
    assert rmse_deg(relative_error_rad(exact, given, PAIR), ALL) > 2.0
    assert rmse_deg(relative_error_rad(exact, found.removed_from(given), PAIR), ALL) < 0.1


def test_limits_are_found_in_spite_of_gaps_and_lost_markers():
    quats = {body: quat_wxyz(turns(seed, TIME_S - 0.02)) for seed, body in ((1, "a"), (2, "b"))}
    quats["a"][200:230] = np.nan
    quats["b"][500:510] = [0.0, 1.0, 0.0, 0.0]
    found = limits(recorded(), Reference("made", TIME_S, quats))
    assert found.lag_s == pytest.approx(0.02, abs=LAG_BOUND_S)


def test_a_drifting_clock_and_jumps_of_a_reference_are_found_and_removed():
    drift, half_s = 2e-4, TIME_S[-1] / 2
    true_s = TIME_S - 0.02 - drift * (TIME_S - half_s)
    quats = {body: quat_wxyz(turns(seed, true_s)) for seed, body in ((1, "a"), (2, "b"))}
    quats["b"][500:510] = [0.0, 1.0, 0.0, 0.0]
    given = Reference("made", TIME_S, quats)
    found = limits(recorded(), given)
    assert found.drift == pytest.approx(drift, abs=LAG_BOUND_S / half_s)
    assert found.lag_s == pytest.approx(0.02, abs=LAG_BOUND_S)
    # Ten rows are wrong; the differences at both ends of that stretch jump.
    assert len(found.jumps_s["a"]) == 0
    removed = found.removed_from(given)
    beside = np.r_[499:502, 508:511]
    assert np.isnan(removed.quat_wxyz["b"][beside]).all()
    kept = ALL.copy()
    kept[500:510] = False
    exact = estimate(time_s=recorded()["a"].time_s)
    assert rmse_deg(relative_error_rad(exact, removed, PAIR), kept) < 0.1


def test_a_nominal_mount_is_taken_into_account():
    mount = Rotation.from_euler("y", -90, degrees=True)
    quats = {b: quat_wxyz(rotation(q) * mount.inv()) for b, q in reference().quat_wxyz.items()}
    found = limits(recorded(), Reference("made", TIME_S, quats), {"a": mount, "b": mount})
    assert max(t.magnitude() for t in found.turns.values()) < TURN_BOUND_RAD


def test_summing_up_rates_gives_an_estimate_that_is_half_a_step_early():
    recording = recorded(rate_hz=50.0)
    quats = {}
    for body in PAIR:
        turn, rows = Rotation.identity(), []
        for rate in recording[body].gyro_rad_s:
            turn = turn * Rotation.from_rotvec(np.array(rate) / 50.0)
            rows.append(quat_wxyz(turn))
        quats[body] = np.array(rows)
    summed = OrientationEstimate("made", recording["a"].time_s, quats)
    assert delay_s(recording, summed) == pytest.approx(-0.01, abs=LAG_BOUND_S)


def test_later_moves_the_reference_back():
    assert later(reference(), 0.02).time_s[0] == pytest.approx(-0.02)


def test_chain_of_hinges():
    angles = np.array([[0.1, 0.2, 0.3, -0.5]])
    found = world_from_links((Link("a", "yxz"), Link("b", "y")), angles)
    expected = Rotation.from_euler("YXZ", angles[0, :3])
    assert (rotation(found["a"])[0].inv() * expected).magnitude() < ROUNDING_RAD
    assert twist_rad(rotation(found["a"]).inv() * rotation(found["b"]), "y") == pytest.approx(-0.5)


def test_links_that_hang_on_one_link():
    tree = (Link("trunk", "z"), Link("left", "x"), Link("right", "y", parent="trunk"))
    found = world_from_links(tree, np.array([[0.3, 0.4, -0.5]]))
    expected = Rotation.from_euler("ZY", [0.3, -0.5])
    assert (rotation(found["right"])[0].inv() * expected).magnitude() < ROUNDING_RAD


def test_inverse_kinematics_on_joints_that_allow_every_orientation_returns_them():
    opensim()
    tree = (Link("a", "yxz"), Link("c", "zxy"), Link("b", "zxy", parent="a"))
    quats = {name: quat_wxyz(turns(seed)) for seed, name in enumerate("abc")}
    (posture,) = chains.opensim(OrientationEstimate("made", TIME_S, quats), tree)
    for name, quat in quats.items():
        error = rotation(posture.estimate.quats[name]).inv() * rotation(quat)
        assert error.magnitude().max() < np.radians(SOLVED_DEG)


def test_the_worst_stretch_is_that_of_oarlock():
    error = {
        "Other": np.where(TIME_S < 5.0, 9.0, 1.0),
        "Oarlock": np.where((TIME_S > 12.0) & (TIME_S < 14.0), 3.0, 0.5),
    }
    errors = {n: (OrientationEstimate(n, TIME_S, {}), e) for n, e in error.items()}
    stretch = worst_window(errors, TIME_S, TIME_S > 1.0, 2.0)
    assert stretch.start_s == pytest.approx(12.0, abs=0.05)
    assert stretch.rms_deg == pytest.approx(3.0, abs=0.1)
    _, plot = worst_plot("name", "what", errors, TIME_S, ALL, 2.0, [("angle, deg", TIME_S)])
    assert [label for label, _ in plot.panels] == ["error, deg", "angle, deg"]
    assert [curve.kind for curve in plot.panels[0][1]] == ["other", "ours"]
    assert worst_plot("name", "what", {}, TIME_S, ALL, 2.0) == (0.0, None)


def test_software_that_does_not_run_is_a_line_with_a_reason():
    def absent():
        import a_package_that_nobody_has  # noqa: F401

    def unable():
        raise NotRunError("no model")

    def broken():
        raise ZeroDivisionError

    assert attempt(["A", "B"], absent) == [
        Missing("A", "not installed (a_package_that_nobody_has)"),
        Missing("B", "not installed (a_package_that_nobody_has)"),
    ]
    assert attempt(["A"], unable) == [Missing("A", "not run: no model")]
    with pytest.raises(ZeroDivisionError):
        attempt(["A"], broken)


def gathered():
    collected = Collected()
    collected.add(OrientationEstimate("Other", TIME_S, {}), {"one": 2.0, "two": 4.0})
    collected.add(Missing("Oarlock", "not run: <no model>"), {})
    return collected.table("Errors", mean=True)


def test_a_table_has_ours_first_and_a_mean_only_where_all_is_there():
    table = gathered()
    assert [row.name for row in table.rows] == ["Oarlock", "Other"]
    assert table.columns == ("one", "two", "mean")
    assert table.rows[0].cells == (None, None, None)
    assert table.rows[1].cells == (2.0, 4.0, 3.0)


def test_page_and_figures(tmp_path):
    results = [
        SetResult("here", "Data & more", "text", (gathered(),)),
        SetResult("gone", "Not there", "text", absent="no folder"),
    ]
    written, figures = page.write(results, {"vqf": "1.0"}, tmp_path / "out")
    text = written.read_text(encoding="utf-8")
    assert "Data &amp; more" in text and "not run: &lt;no model&gt;" in text and "Not run: no folder" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    found = json.loads(figures.read_text(encoding="utf-8"))
    assert found["sets"]["here"]["tables"][0]["rows"]["Other"]["mean"] == 3.0
    assert found["sets"]["gone"]["absent"] == "no folder"


def test_a_figure_that_is_no_number_is_null(tmp_path):
    collected = Collected()
    collected.put("Other", {"one": float("nan")})
    _, figures = page.write([SetResult("s", "t", "", (collected.table("x"),))], {}, tmp_path)
    assert (
        json.loads(figures.read_text(encoding="utf-8"))["sets"]["s"]["tables"][0]["rows"]["Other"]["one"]
        is None
    )


def test_plots_are_drawn_with_names_of_their_own():
    pytest.importorskip("matplotlib", reason="matplotlib draws the page's plots; it is not needed to track")
    from oarlock_lab.validation.plots import svg

    errors = {"Other": (OrientationEstimate("Other", TIME_S, {}), TIME_S)}
    drawn = [svg(worst_plot(name, "what", errors, TIME_S, ALL, 2.0)[1]) for name in ("one", "two", "one")]
    assert drawn[0].startswith("<svg") and "Other" in drawn[0]
    assert drawn[0] == drawn[2]
    assert drawn[0] != drawn[1]


def test_rests_of_the_trunk_are_those_that_last():
    time_s = np.arange(0.0, 12.0, 0.01)
    moving = (time_s > 4.0) & (time_s < 6.0) | (time_s > 8.0) & (time_s < 8.5)
    gyro = np.where(moving, 1.0, 0.01)[:, None] * np.array([1.0, 0.0, 0.0])
    accel = np.tile([0.0, 0.0, 9.8], (len(time_s), 1))
    recording = Recording([ImuStream(s, time_s, gyro_rad_s=gyro, accel_m_s2=accel) for s in qmt.TRUNK])
    # 6 to 8 s is too short
    assert np.array(qmt.rests(recording)) == pytest.approx(np.array([[0.0, 4.0], [8.5, 11.99]]), abs=0.011)


def test_what_is_absent_is_named_and_the_run_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("OARLOCK_DATA", str(tmp_path))
    (tmp_path / "data").mkdir()
    code = run_validation(
        ["--out", str(tmp_path / "out"), "--only", "dfjimu", "diodem", "openaxes", "broad", "qmt"]
    )
    assert code == 1
    found = json.loads((tmp_path / "out/figures.json").read_text(encoding="utf-8"))["sets"]
    assert all(
        found[name]["absent"] for name in ("dfjimu", "diodem_arm", "openaxes_ur5", "broad", "qmt_full_body")
    )
    assert "dfjimu: absent: no data_*.mat in dfjimu/" in capsys.readouterr().out


def test_the_simulated_arm_is_what_its_units_feel_and_passes_the_pole():
    trial = singular.simulated(1)
    # Biases apart, both rates agree: noise of 0.005 rad/s over 4000 samples leaves next to nothing.
    found = limits(trial.recording, trial.reference)
    assert abs(found.lag_s) < 1e-3
    assert max(turn.magnitude() for turn in found.turns.values()) < 2e-3
    distance = np.degrees(trial.pole_distance_rad)
    passes = (distance[1:-1] < distance[:-2]) & (distance[1:-1] <= distance[2:]) & (distance[1:-1] < 5.0)
    assert np.count_nonzero(passes) >= 15
    assert distance.max() > 30.0


@pytest.mark.parametrize("name", ["arm_ball", "arm_hinges", "arm_truth"])
def test_models_of_the_simulated_arm(name):
    model = load_model(str(singular.MODELS / f"{name}.toml"))
    assert set(singular.BODIES) <= set(model.frame_names)
    assert tuple(model.sensor_names) == singular.BODIES
