"""Catches and finishes against the true reversals of simulated sessions: offline, live, and from other sources."""

from functools import cache

import numpy as np
import pytest

import oarlock
from exact_recording import Floats, sculler
from oarlock.rowing import (
    FieldEffects,
    FieldTrial,
    LiveStrokes,
    Strokes,
    ergometer_piece,
    find_strokes,
    simulate_field,
    sweep_piece,
)
from refusals import assert_refused
from rowed_session import Part, Rowed, rowed, ten_minutes

BIAS_S, SD_S = 0.002, 0.005
"""What is asked of catch and finish under 0.1 deg of encoder noise."""
ANGLE_RAD = np.radians(0.5)
CLOSED_FORM_S = 1e-4
"""Between knots at 400 Hz the phase is taken as a line."""
LIVE_S = 0.3
"""A finish is published within this time."""
SHORTEST_RATIO, LONGEST_RATIO = 0.6, 1.35
"""Of error to claimed standard deviation, root mean square over hundreds of strokes."""
COVERED = 0.9
"""Of events of seat and trunk that lie in their 95 % bands; a session has a few dozen."""


SESSIONS = [(11, 50.0), pytest.param(12, 100.0, marks=pytest.mark.long)]
"""Seeds and rates of sessions of ten minutes."""


@cache
def session(seed: int) -> Rowed:
    return rowed(ten_minutes(), seed)


@cache
def found(seed: int, rate_hz: float) -> Strokes:
    return find_strokes(session(seed).recording(rate_hz, seed))


def nearest(times: Floats, true: Floats) -> Floats:
    """Error of each time against the nearest true one, s."""
    return times - true[np.abs(true[None] - times[:, None]).argmin(axis=1)]


def known(values: Floats) -> Floats:
    return values[np.isfinite(values)]


@pytest.mark.parametrize(("seed", "rate_hz"), SESSIONS)
def test_no_stroke_of_ten_minutes_is_missed_or_invented(seed, rate_hz):
    rows, truth = found(seed, rate_hz), session(seed)
    assert truth.end_s > 600.0
    assert len(rows) == sum(part.strokes for part in truth.parts)
    for column, true in (
        ("r_catch_time_s", truth.lows["r_oar_phi"]),
        ("r_finish_time_s", truth.highs["r_oar_phi"]),
    ):
        near = np.abs(true[None] - rows.table()[column][:, None]).argmin(axis=1)
        assert np.array_equal(near, np.arange(len(true)))


@pytest.mark.parametrize(("seed", "rate_hz"), SESSIONS)
@pytest.mark.parametrize("event", ["catch", "finish"])
def test_times_are_those_of_the_motion(seed, rate_hz, event):
    table, truth = found(seed, rate_hz).table(), session(seed)
    for side in "rl":
        true = (truth.lows if event == "catch" else truth.highs)[f"{side}_oar_phi"]
        times = known(table[f"{side}_{event}_time_s"])
        error, claimed = nearest(times, true), known(table.std(f"{side}_{event}_time_s"))
        assert abs(error.mean()) < BIAS_S and error.std() < SD_S
        assert SHORTEST_RATIO < np.sqrt(np.mean((error / claimed) ** 2)) < LONGEST_RATIO


@pytest.mark.parametrize("rate", [20.0, 28.0, 36.0])
def test_times_at_one_rate(rate):
    """So that a long stretch of quick strokes does not hide slow ones."""
    truth = rowed((Part(40, rate),), int(rate))
    table = find_strokes(truth.recording(50.0, 3)).table()
    for event, true in (("catch", truth.lows), ("finish", truth.highs)):
        error = nearest(table[f"l_{event}_time_s"], true["l_oar_phi"])
        assert abs(error.mean()) < BIAS_S and error.std() < SD_S


@pytest.mark.parametrize(("seed", "rate_hz"), SESSIONS)
def test_angles_are_those_of_the_motion(seed, rate_hz):
    table, truth = found(seed, rate_hz).table(), session(seed)
    for side in "rl":
        spline = truth.splines[f"{side}_oar_phi"]
        for event, true in (("catch", truth.lows), ("finish", truth.highs)):
            angle = known(table[f"{side}_{event}_angle_rad"])
            times = known(table[f"{side}_{event}_time_s"])
            at = true[f"{side}_oar_phi"]
            at = at[np.abs(at[None] - times[:, None]).argmin(axis=1)]
            assert np.abs(angle - spline(at)).max() < ANGLE_RAD


def test_the_simulated_reversals_are_those_of_its_phase():
    """Without variation the oars turn where the phase, which is known in closed form, is whole or a half: the right one
    0.0015 of a stroke before, the left one as much after."""
    truth = rowed((Part(12, 24.0),), 1, variation=0.0)
    whole = np.arange(np.ceil(truth.timing.phase[0]), truth.timing.phase[-1])
    for side, sign in (("r", -1.0), ("l", 1.0)):
        for share, found_s in ((0.0, truth.lows), (0.5, truth.highs)):
            known_s = np.interp(whole + share + 0.0015 * sign, truth.timing.phase, truth.timing.time_s)
            own = found_s[f"{side}_oar_phi"]
            assert len(own) == 12
            assert np.abs(nearest(own, known_s)).max() < CLOSED_FORM_S


def test_kinds_are_told_apart():
    rows, truth = found(11, 50.0), session(11)
    laid_out = [part.kind for part in truth.parts for _ in range(part.strokes)]
    for kind in ("turn", "paddling"):
        assert [k == kind for k in rows.kinds] == [k == kind for k in laid_out]
    pauses = [s for s in rows.stretches if s.kind == "pause"]
    laid_pauses = [part.pause_s for part in truth.parts if part.pause_s]
    inner = [p.end_s - p.start_s for p in pauses if p.start_s > 5.0 and p.end_s < truth.end_s - 1.0]
    assert len(inner) == len(laid_pauses)
    assert all(measured > planned for measured, planned in zip(inner, laid_pauses, strict=True))
    first = next(i for i, k in enumerate(laid_out) if k == "start")
    assert rows.kinds[first : first + 4] == ("start",) * 4


def test_what_is_no_steady_rowing_counts_in_no_average():
    rows = found(11, 50.0)
    for kind, counts, reason in zip(rows.kinds, rows.in_averages, rows.left_out, strict=True):
        assert counts == (reason == "")
        assert kind == "rowing" or not counts
    assert rows.in_averages.sum() > 150


def test_a_pause_ends_no_stroke():
    rows, table = found(11, 50.0), found(11, 50.0).table()
    assert rows.paused.sum() >= 5
    assert np.isnan(table["rate_per_min"][rows.paused]).all()
    reasons = np.array(table.reason("rate_per_min"))[rows.paused]
    assert all("pause" in reason or "no next catch" in reason for reason in reasons)
    rates = known(table["rate_per_min"])
    assert rates.min() > 14.0 and rates.max() < 40.0


def live(recording: oarlock.Recording, strokes: LiveStrokes) -> list:
    right, left = recording["r_oar_phi"], recording["l_oar_phi"]
    rows = zip(right.time_s.tolist(), right.value.tolist(), left.value.tolist(), strict=True)
    return [
        event
        for time_s, phi_r, phi_l in rows
        for event in strokes.step(time_s, {"r_oar_phi": phi_r, "l_oar_phi": phi_l})
    ]


@pytest.mark.parametrize("seed", [13])
def test_live_finds_the_same_at_once(seed):
    parts = (
        Part(12, 20.0, pause_s=5.0),
        Part(12, 36.0),
        Part(5, 20.0, left=0.02, pause_s=3.0),
        Part(8, 28.0),
    )
    recording = rowed(parts, seed).recording(50.0, seed)
    rows, events = find_strokes(recording), live(recording, LiveStrokes())
    finishes = [event for event in events if event.kind == "finish"]
    catches = [event for event in events if event.kind == "catch"]
    times = np.array([event.time_s for event in finishes])
    assert len(times) == len(rows) == 37
    assert np.abs(times - rows.finish_time_s).max() < 1.0 / 50.0
    assert (
        np.abs(nearest(rows.catch_time_s, np.array([event.time_s for event in catches]))).max() < 1.0 / 50.0
    )
    assert max(event.published_s - event.time_s for event in finishes) < LIVE_S
    drives = np.array([event.drive_time_s for event in finishes])
    assert known(drives) == pytest.approx(
        (rows.finish_time_s - rows.catch_time_s)[np.isfinite(drives)], abs=1e-9
    )


def test_live_refuses_times_that_run_backwards_and_unknown_sources():
    strokes = LiveStrokes()
    strokes.step(1.0, {"r_oar_phi": 0.0})
    assert_refused(lambda: strokes.step(0.5, {"r_oar_phi": 0.0}), "order of time")
    assert_refused(lambda: LiveStrokes("wind"), "oars, handle, seat")
    assert_refused(lambda: LiveStrokes("trunk_gyro"), "needs the model")


def test_live_from_the_trunks_gyroscope():
    recording = simulate_field(sculler(), FieldEffects(), duration_s=20.0, rate_spm=26.0, seed=31).recording
    rows = find_strokes(recording, source="trunk_gyro", model=sculler())
    strokes, back = LiveStrokes("trunk_gyro", sculler()), recording["back"]
    events = [
        e for t, w in zip(back.time_s, back.gyro_rad_s, strict=True) for e in strokes.step(t, {"back": w})
    ]
    finishes = np.array([event.time_s for event in events if event.kind == "finish" and not event.replaces])
    assert np.abs(nearest(finishes, rows.finish_time_s)).max() < 1e-9


@cache
def field_trial(effects: FieldEffects, seed: int, rate: float | tuple[float, float]) -> FieldTrial:
    return simulate_field(sculler(), effects, duration_s=25.0, rate_spm=rate, seed=seed)


@pytest.mark.parametrize(
    ("seed", "rate", "effects"),
    [
        pytest.param(21, 20.0, FieldEffects(), marks=pytest.mark.long),
        (22, (20.0, 34.0), FieldEffects.wild()),
    ],
)
@pytest.mark.parametrize("source", ["seat", "trunk_gyro"])
def test_seat_and_trunk_say_how_little_they_know(seed, rate, effects, source):
    trial = field_trial(effects, seed, rate)
    true = find_strokes(trial.truth)
    for model in (None, sculler()) if source == "trunk_gyro" else (None,):
        rows = find_strokes(trial.recording, source=source, model=model)
        assert len(true) - 2 <= len(rows) <= len(true)
        for event in ("catch", "finish"):
            error = nearest(getattr(rows, f"{event}_time_s"), getattr(true, f"{event}_time_s"))
            claimed = getattr(rows, f"{event}_time_std_s")
            assert np.mean(np.abs(error) < 1.96 * claimed) >= COVERED
            assert claimed.mean() < 0.2
        assert rows.notes and "less accurate" in rows.notes[0]


def test_sources_are_taken_in_their_order():
    recording = rowed((Part(6, 24.0),), 2).recording(50.0, 2)
    assert find_strokes(recording).source == "oars"
    assert find_strokes(recording.only(["seat"])).source == "seat"
    assert "catch_angle_rad" not in find_strokes(recording.only(["seat"])).table()
    assert_refused(lambda: find_strokes(recording, source="legs"), "no source 'legs'")
    assert_refused(lambda: find_strokes(recording.only(["seat"]), source="oars"), "give such a stream")


def test_one_oar_is_enough_and_noted():
    rows = find_strokes(rowed((Part(8, 24.0),), 2).recording(50.0, 2).only(["r_oar_phi"]))
    assert len(rows) == 8 and "right (port)" in rows.notes[0]
    table = rows.table()
    assert "r_arc_rad" in table and table["arc_rad"] == pytest.approx(table["r_arc_rad"])
    assert set(rows.kinds) <= {"rowing", "start"}


def test_a_frozen_encoder_is_no_turn_and_degrees_are_refused():
    recording = rowed((Part(8, 24.0),), 2).recording(50.0, 2)
    right = recording["r_oar_phi"]
    frozen = oarlock.recording.ScalarStream("l_oar_phi", right.time_s, np.full(len(right), 0.2))
    rows = find_strokes(oarlock.Recording([right, frozen]))
    assert len(rows) == 8 and "turn" not in rows.kinds
    assert any("left (starboard) oar never moved" in note for note in rows.notes)
    degrees = oarlock.recording.ScalarStream("r_oar_phi", right.time_s, np.degrees(right.value))
    assert_refused(lambda: find_strokes(oarlock.Recording([degrees])), "Degrees")


def test_a_silent_oar_is_no_turn_and_a_long_silence_breaks_strokes():
    recording = rowed((Part(20, 24.0),), 4).recording(50.0, 4)
    right, left = recording["r_oar_phi"], recording["l_oar_phi"]
    gone = (left.time_s > 20.0) & (left.time_s < 30.0)
    streams = [right, oarlock.recording.ScalarStream("l_oar_phi", left.time_s[~gone], left.value[~gone])]
    rows = find_strokes(oarlock.Recording(streams))
    assert len(rows) == 20 and "turn" not in rows.kinds
    both = (right.time_s > 20.0) & (right.time_s < 30.0)
    streams = [oarlock.recording.ScalarStream(s.name, s.time_s[~both], s.value[~both]) for s in (right, left)]
    rows = find_strokes(oarlock.Recording(streams))
    assert 14 <= len(rows) <= 17
    across = (rows.catch_time_s < 20.0) & (rows.end_time_s > 30.0)
    assert not across.any()


def test_missing_readings_and_spikes_move_no_stroke():
    recording = rowed((Part(20, 26.0),), 5).recording(100.0, 5)
    rng = np.random.default_rng(5)
    streams = []
    for stream in (recording["r_oar_phi"], recording["l_oar_phi"]):
        value = stream.value.copy()
        value[rng.random(len(value)) < 0.2] = np.nan
        value[rng.random(len(value)) < 0.002] += np.radians(4.0)
        streams.append(oarlock.recording.ScalarStream(stream.name, stream.time_s, value))
    rows, plain = find_strokes(oarlock.Recording(streams)), find_strokes(recording)
    assert len(rows) == len(plain)
    assert np.median(np.abs(rows.catch_time_s - plain.catch_time_s)) < BIAS_S
    assert np.abs(rows.catch_time_s - plain.catch_time_s).max() < 0.03


def test_nothing_that_moves_is_no_stroke():
    time_s = np.arange(0.0, 20.0, 0.02)
    stream = oarlock.recording.ScalarStream("r_oar_phi", time_s, 0.1 * np.sin(time_s))
    rows = find_strokes(oarlock.Recording([stream]))
    assert len(rows) == 0 and "No stroke" in rows.notes[-1]
    assert [stretch.kind for stretch in rows.stretches] == ["pause"]
    assert len(rows.table()) == 0


def test_sweep_and_ergometer():
    sweep = sweep_piece(oarlock.load_model("sweep"), 10.0, 26.0, seed=3)
    ergometer = ergometer_piece(oarlock.load_model("ergometer"), 10.0, 26.0, seed=3)
    for piece, name, column in ((sweep, "oar_phi", "arc_rad"), (ergometer, "handle", "handle_travel_m")):
        time_s = np.arange(0.0, 10.0, 0.01)
        value = np.interp(time_s, piece.motion.time_s, piece.motion.column(name))
        rows = find_strokes(oarlock.Recording([oarlock.recording.ScalarStream(name, time_s, value)]))
        assert len(rows) == 4
        assert rows.table()[column] == pytest.approx(np.ptp(value), rel=0.05)
