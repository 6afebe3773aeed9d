"""Clocks that are off, found from what all streams see."""

import json

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock import Calibration, Recording
from oarlock.calibration.clocks.coarse import coarse_delays
from oarlock.calibration.clocks.devices import most_agree, reference_streams, unknowns
from oarlock.calibration.clocks.lines import (
    CRYSTAL_DRIFT,
    MODEL_STD_S,
    after,
    line,
    usual_drift,
    usual_scatter,
)
from oarlock.recording import Clock, ImuStream, ScalarStream
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.simulation import Motion

FOUND_S = 5e-4
"""Where all else is as modelled: ten times what was measured on an arm in 18 s, five times on a sculler in 14 s."""
COARSE_S = 0.06
"""What the fine search can mend from."""
SCATTER_S, STDS = 3e-4, 4.0


def late(recording, clocks):
    """The same samples, stamped by other clocks."""
    streams = []
    for s in recording:
        stamps = clocks.get(s.name, Clock(0.0)).stamps_s(s.time_s)
        if isinstance(s, ImuStream):
            streams.append(ImuStream(s.name, stamps, **s.values))
        else:
            streams.append(ScalarStream(s.name, stamps, s.value, s.unit))
    return Recording(streams, recording.meta)


def restless_arm(duration_s=18.0):
    """An arm that keeps turning about all its joints, seen by its three units."""
    model = oarlock.load_model("arm7")
    knots = np.arange(0.0, duration_s, 0.02)
    pace = np.array([0.61, 0.83, 1.07, 0.71, 0.93, 1.27, 0.53])
    size = np.array([0.5, 0.4, 0.6, 0.5, 0.5, 0.3, 0.4])
    q = size * (np.sin(2 * np.pi * pace * knots[:, None]) + 0.3 * np.sin(5.3 * pace * knots[:, None]))
    q[:, 3] += 1.0
    motion = Motion(tuple(model.coordinate_names), knots, q)
    _, recording = oarlock.simulate(model, motion, seed=3, rate_hz=60.0)
    return model, recording


@pytest.fixture(scope="module")
def arm():
    return restless_arm()


def jolted(delay_s=0.0, seed=0):
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, 30.0, 0.01)
    beats = np.sort(np.random.default_rng(9).uniform(1.0, 29.0, 25))
    felt = np.exp(-0.5 * ((time_s[:, None] - beats) / 0.05) ** 2).sum(axis=1)
    rows = np.stack([9.8 + 8.0 * felt, felt, 0.0 * felt], axis=1) + 0.1 * rng.standard_normal((3000, 3))
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return time_s + delay_s, rows @ turn.T


def test_taps_bring_clocks_near_however_the_units_are_turned():
    streams = []
    for k, (name, delay) in enumerate((("a", 0.0), ("b", 0.43), ("c", -0.5))):
        time_s, accel = jolted(delay, k)
        streams.append(ImuStream(name, time_s, accel_m_s2=accel))
    found = coarse_delays(Recording(streams), ("a",))
    assert found["b"] == pytest.approx(0.43, abs=COARSE_S)
    assert found["c"] == pytest.approx(-0.5, abs=COARSE_S)


def test_small_delays_are_left_to_the_fine_search():
    streams = [ImuStream(n, jolted(d)[0], accel_m_s2=jolted(d)[1]) for n, d in (("a", 0.0), ("b", 0.03))]
    assert coarse_delays(Recording(streams), ("a",)) == {}


def test_joints_that_move_in_turn_are_no_delay():
    # Rates of oars and blades correlate by 0.55 to 0.64, half a second apart, and each stream may have its own clock.
    _, recording = simulate_sculling(oarlock.load_model("sculler"), duration_s=14.0, seed=7)
    assert coarse_delays(recording, ()) == {}
    ends = late(recording, {name: Clock(0.3) for name in recording.names if "oar" in name or name == "seat"})
    found = coarse_delays(ends, [name for name in recording.names if "arm" in name or name == "back"])
    assert found["r_oar_phi"] == pytest.approx(0.3, abs=COARSE_S)


def test_a_line_gives_offset_and_drift_within_its_deviations_and_does_not_mind_outliers():
    time_s, truth = np.linspace(5.0, 595.0, 24), Clock(0.004, 5e-5)
    for seed in range(20):
        delay = truth.stamps_s(time_s) - time_s
        delay += SCATTER_S * np.random.default_rng(seed).standard_normal(24)
        delay[seed] += 0.02
        found = line(time_s, delay, np.full(24, SCATTER_S))
        assert abs(found.drift - truth.drift) < STDS * found.drift_std < 4e-6
        assert abs(found.offset_s - truth.offset_s) < 2e-3


def test_a_short_recording_expects_a_crystal_and_a_wild_clock_is_still_found():
    time_s = np.linspace(5.0, 35.0, 8)
    assert line(time_s, np.full(8, 0.004), np.full(8, SCATTER_S)).drift_std < CRYSTAL_DRIFT
    wild = line(time_s, 1.5e-3 * time_s, np.full(8, SCATTER_S))
    assert wild.drift == pytest.approx(1.5e-3, rel=0.02)
    assert wild.offset_std_s > MODEL_STD_S


def test_few_windows_of_many_clocks_show_how_exact_they_are():
    time_s, drifts = np.array([6.5, 11.5, 16.5]), np.array([4e-4, -4e-4] * 5)
    scores, errors = [], []
    for seed in range(20):
        # Windows say 1 ms and scatter by 0.2.
        noise = 2e-4 * np.random.default_rng(seed).standard_normal((3, 10))
        delay, std = time_s[:, None] * drifts + noise, np.full((3, 10), 1e-3)
        scores.append(usual_scatter(time_s, delay, std))
        found = [line(time_s, delay[:, k], std[:, k], usual=scores[-1]) for k in range(10)]
        errors += [(f.drift - drift) / f.drift_std for f, drift in zip(found, drifts, strict=True)]
    assert np.mean(scores) == pytest.approx(0.23, abs=0.05)
    assert np.sqrt(np.mean(np.square(errors))) < 1.0
    assert usual_scatter(time_s, delay[:, :2], std[:, :2]) == 1.0


def test_clocks_that_drift_far_make_a_drift_that_nothing_shows_uncertain():
    time_s, std = np.array([6.5, 11.5, 16.5]), np.full(3, 5e-3)
    assert usual_drift([Clock(0.0, 1e-5), Clock(0.0, -2e-5), Clock(0.0, 9e-4)]) == CRYSTAL_DRIFT
    wide = usual_drift([Clock(0.0, 2e-4), Clock(0.0, -2e-4), Clock(0.0, 1e-6)])
    assert wide == 2e-4
    assert line(time_s, np.zeros(3), std).drift_std < 6e-5
    assert line(time_s, np.zeros(3), std, drift_std=wide).drift_std > 2e-4


def test_two_corrections_are_one():
    time_s, first, then = np.arange(10.0), Clock(0.1, 1e-3), Clock(-0.02, 2e-4)
    both = after(first, then)
    assert np.allclose(then.true_s(first.true_s(time_s)), both.true_s(time_s), atol=1e-12)


def test_streams_that_share_their_stamps_are_the_reference():
    time_s = np.arange(100) / 100
    unit = ImuStream("unit", time_s + 0.001234, gyro_rad_s=np.zeros((100, 3)))
    ends = [ScalarStream(n, time_s, np.zeros(100)) for n in ("one", "two")]
    recording = Recording([unit, *ends])
    assert reference_streams(recording, None) == ("one", "two")
    assert unknowns(recording, ("one", "two")) == [("unit",)]
    assert unknowns(recording, ("unit",)) == [("one", "two")]
    assert reference_streams(Recording([unit, ends[0]]), None) == ()
    assert reference_streams(recording, "unit") == ("unit",)


def test_what_most_clocks_agree_on_is_the_reference_where_none_is_named():
    clocks = {n: Clock(o, 0.0, 1e-4, 1e-6) for n, o in (("a", 0.0), ("b", 0.05), ("c", 0.0005))}
    assert most_agree(clocks, 10.0) == ("a", "c")
    unsure = {"any": Clock(0.0, 5e-5, 2e-3, 3e-4)}
    drifting = {n: Clock(0.0, d, 2e-3, 2e-5) for n, d in (("a", 2e-4), ("b", -2e-4), ("c", 1.8e-4))}
    assert most_agree(unsure | drifting, 10.0) == ("a", "c")


def test_clocks_of_an_arm_are_found_against_one_of_its_units(arm):
    model, recording = arm
    true = {"forearm": Clock(0.02), "hand": Clock(-0.015)}
    found = oarlock.calibration.calibrate_clocks(model, late(recording, true), reference="upperarm")
    assert found.noted["clocks"]["reference"] == ["upperarm"]
    for name, clock in true.items():
        assert name in found.clocks, found.noted["clocks"]
        assert found.clocks[name].offset_s == pytest.approx(clock.offset_s, abs=FOUND_S)


@pytest.mark.long
def test_clocks_of_a_sculler_are_found_against_seat_and_oars():
    model = oarlock.load_model("sculler")
    _, recording = simulate_sculling(model, duration_s=14.0, seed=7)
    true = {"back": Clock(0.012), "l_forearm": Clock(-0.018), "r_upperarm": Clock(0.006)}
    found = oarlock.calibration.calibrate_clocks(model, late(recording, true))
    assert found.clocks.keys() == true.keys(), found.noted["clocks"]
    for name, clock in found.clocks.items():
        in_the_middle = clock.offset_s + 7.0 * clock.drift
        assert in_the_middle == pytest.approx(true[name].offset_s, abs=FOUND_S)


def test_one_clock_for_all_stays_one(arm):
    model, recording = arm
    found = oarlock.calibration.calibrate_clocks(model, recording, reference="upperarm")
    assert not found.clocks
    assert all("shares its time stamps" in reason for reason in found.noted["clocks"]["refused"].values())


def test_where_no_stream_keeps_true_time_most_agree(arm):
    model, recording = arm
    jittered = {"upperarm": Clock(1e-7), "forearm": Clock(0.0), "hand": Clock(0.02)}
    found = oarlock.calibration.calibrate_clocks(model, late(recording, jittered))
    assert found.noted["clocks"]["reference"] == ["upperarm", "forearm"]
    assert found.clocks["hand"].offset_s == pytest.approx(0.02, abs=FOUND_S)


def test_a_stream_that_hardly_moves_is_refused_with_the_reason(arm):
    model, _ = arm
    knots = np.arange(0.0, 12.0, 0.05)
    rest = np.tile([0.1, 0.1, 0.2, 0.6, 0.1, 0.0, 0.0], (len(knots), 1))
    still = Motion(tuple(model.coordinate_names), knots, rest)
    _, recording = oarlock.simulate(model, still, seed=1, rate_hz=50.0)
    found = oarlock.calibration.calibrate_clocks(model, recording, reference="upperarm")
    assert not found.clocks
    assert set(found.noted["clocks"]["refused"]) == {"forearm", "hand"}


def test_what_is_known_stays(arm):
    model, recording = arm
    known = Calibration(noted={"of": "yesterday"}, gyro_biases_rad_s={"hand": [0.0, 0.0, 0.0]})
    with pytest.raises(oarlock.DataError, match="nothing to compare"):
        oarlock.calibration.calibrate_clocks(
            model, recording, known, reference=["upperarm", "forearm", "hand"]
        )
    with pytest.raises(oarlock.DataError, match="at least 8 s"):
        oarlock.calibration.calibrate_clocks(model, recording.slice(0, 5), reference="upperarm")
    with pytest.raises(oarlock.DataError, match='no stream "uperarm"'):
        oarlock.calibration.calibrate_clocks(model, recording, reference="uperarm")


def test_the_verb_writes_a_calibration_and_says_whose_clock_is_late(arm, tmp_path):
    _, recording = arm
    late(recording, {"hand": Clock(0.02)}).slice(0.0, 10.0).save(tmp_path / "rec")
    out = tmp_path / "cal.toml"
    words = ["calibrate", "clocks", tmp_path / "rec", "--model", "arm7", "--reference", "upperarm,forearm"]
    told = json.loads(run(*words, "--out", out, "--json").stdout)
    assert told["noted"]["clocks"]["reference"] == ["upperarm", "forearm"]
    assert oarlock.load_calibration(out).clocks.keys() == told["clocks"].keys()
    run(*words, "--out", out, status=2)
