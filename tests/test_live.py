"""Live use and whole recordings are the same arithmetic: bit for bit, also across a cut."""

from typing import Any

import numpy as np
import pytest

import oarlock
from exact_recording import UNITS, load_excerpt, lossy, sculler
from oarlock.tracking.records import FIELD
from refusals import assert_refused

SPAN_S = 3.0
CUT_S = 1.304  # a stamp of the recording
MIDDLE_S = 1.3
STARTS_S = {"tree": oarlock.Config().start_window_s, "strapdown": 1.0}
"""Time from the first sample to the first estimate of a live tracker."""
STARTED = 140
"""Samples after which strapdown links have estimates."""


@pytest.fixture(scope="module")
def recording() -> oarlock.Recording:
    return load_excerpt().recording.slice(end_s=SPAN_S)


@pytest.fixture(scope="module")
def gappy(recording: oarlock.Recording) -> oarlock.Recording:
    """A fifth of every stream's rows lost, each stream its own: samples hold what happens to be there."""
    return lossy(recording, 0.2, seed=4, whole=False)


@pytest.fixture(scope="module")
def track(recording: oarlock.Recording) -> oarlock.Track:
    return oarlock.track(sculler(), recording)


def streamed(tracker: oarlock.Tracker, samples: list[Any]) -> list[tuple[Any, Any]]:
    return [tracker.step(sample) for sample in samples]


def assert_same_belief(one: oarlock.Belief, other: oarlock.Belief) -> None:
    assert one.time_s == other.time_s
    for name in ("mean", "covariance", "seen_s", "rejected_since_s"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name


def assert_same_rows(one: oarlock.Track, other: oarlock.Track, rows: Any = slice(None)) -> None:
    for name in ("time_s", "q", "qd", "qdd", "q_std", "qd_std", "qdd_std", "observed"):
        assert np.array_equal(getattr(one, name)[rows], getattr(other, name), equal_nan=name != "observed"), (
            name
        )
    for name in ("nis", "used", "rejected", "missing", "inertial_nis", "inertial_used", "field"):
        ours, theirs = getattr(one.info, name)[rows], getattr(other.info, name)
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f"), name
    for name, slow in one.slow.items():
        assert np.array_equal(slow.value[rows], other.slow[name].value, equal_nan=True), name
        assert np.array_equal(slow.std[rows], other.slow[name].std, equal_nan=True), name


@pytest.mark.parametrize("structure", STARTS_S)
@pytest.mark.parametrize("source", ["recording", "gappy"])
def test_stream_equals_batch(source, structure, request):
    recording = request.getfixturevalue(source)
    whole = oarlock.track(sculler(), recording, config=oarlock.Config(structure=structure))
    tracker = oarlock.Tracker(sculler(), config=oarlock.Config(**whole.provenance["config"]))
    steps = streamed(tracker, tracker.samples(recording))
    assert [info.time_s for _, info in steps] == list(whole.time_s)
    started = next(i for i, (belief, _) in enumerate(steps) if belief is not None)
    assert [info.status for _, info in steps] == ["starting"] * started + ["tracking"] * (
        len(steps) - started
    )
    assert whole.time_s[started] - whole.time_s[0] == pytest.approx(STARTS_S[structure], abs=0.02)
    rows = {time_s: row for row, time_s in enumerate(whole.time_s)}
    # An estimate of strapdown links waits for later readings of all units.
    for row, step in enumerate(steps[started:], started):
        estimated = rows[step[0].time_s]
        assert estimated == row or (structure, source) == ("strapdown", "gappy")
        assert_step_is_row(step, whole, estimated)
    if estimated == len(whole.time_s) - 1:
        assert_same_belief(tracker.belief, whole.last_belief)


def assert_step_is_row(step: tuple[Any, Any], whole: oarlock.Track, row: int) -> None:
    belief, info = step
    mean = dict(zip(belief.state_names, belief.mean, strict=True))
    std = dict(zip(belief.state_names, belief.std, strict=True))
    for column, name in enumerate(whole.joint_names):
        for suffix, kind in (("", "q"), (".velocity", "qd"), (".acceleration", "qdd")):
            if name + suffix in mean:
                assert getattr(whole, kind)[row, column] == mean[name + suffix]
                assert getattr(whole, f"{kind}_std")[row, column] == std[name + suffix]
    for column, name in enumerate(whole.info.sensor_names):
        found = info.sensors[name]
        assert np.array_equal(found["nis"], whole.info.nis[row, column], equal_nan=True)
        assert all(found[k] == getattr(whole.info, k)[row, column] for k in ("used", "rejected", "missing"))
        assert found["field"] == FIELD[whole.info.field[row, column]]
    assert info.inertial == (whole.info.inertial_nis[row], whole.info.inertial_used[row])


def readings_at(recording: oarlock.Recording, row: int) -> dict[str, Any]:
    """One instant as a program at the sensors would hand it over."""
    readings: dict[str, Any] = {}
    for s in recording.streams:
        values = {name: v[row] for name, v in s.values.items()}
        readings[s.name] = values if s.name in UNITS else values["value"]
    return readings


def test_dictionaries_equal_samples(recording):
    native, plain = oarlock.Tracker(sculler()), oarlock.Tracker(sculler())
    for row, sample in enumerate(native.samples(recording)[: STARTED + 20]):
        native.step(sample)
        time_s, readings = recording.streams[0].time_s[row], readings_at(recording, row)
        if row % 2:
            plain.step(time_s, readings)
        else:
            plain.step(plain.sample(time_s, readings))
    assert_same_belief(native.belief, plain.belief)


def test_absent_keys_are_missing_readings(recording):
    """In a tree, which estimates each sample at once; strapdown links wait for the next reading of each unit."""
    tracker = oarlock.Tracker(sculler(), config=oarlock.Config(structure="tree"))
    streamed(tracker, tracker.samples(recording)[:40])
    back = recording["back"]
    gyro = [*back.gyro_rad_s[40, :2], np.nan]
    _, info = tracker.step(back.time_s[40], {"back": {"gyro_rad_s": gyro}})
    expected = {"nis": 0, "used": 2, "rejected": 0, "missing": 7, "field": "missing", "fault": "none"}
    assert info.sensors["back"] | {"nis": 0} == expected
    assert info.sensors["r_forearm"]["missing"] == 9
    assert info.sensors["r_grip"]["used"] == 0
    assert np.isnan(info.innovation[2:]).all()


@pytest.mark.parametrize("cut_s", [CUT_S, MIDDLE_S])
@pytest.mark.parametrize(
    ("source", "structure"),
    # Strapdown links estimate a row without readings from the readings after it, which a cut takes away.
    [("recording", "tree"), ("recording", "strapdown"), ("gappy", "tree")],
)
def test_cut_equals_uncut(source, structure, cut_s, request):
    recording = request.getfixturevalue(source)
    whole = oarlock.track(sculler(), recording, config=oarlock.Config(structure=structure))
    found = oarlock.Config(**whole.provenance["config"])
    before = oarlock.track(sculler(), recording.slice(end_s=cut_s), config=found)
    after = oarlock.track(sculler(), recording.slice(start_s=cut_s), config=found, start=before.last_belief)
    rows = len(before.time_s)
    assert rows + len(after.time_s) == len(whole.time_s)
    assert_same_rows(whole, before, slice(rows))
    # The sum of the innovations belongs to the last update, which may lie before the cut.
    updated = np.flatnonzero(after.info.inertial_used)[0] if structure == "strapdown" else 0
    whole.info.inertial_nis[rows:][:updated] = np.nan
    whole.info.inertial_used[rows:][:updated] = 0
    assert_same_rows(whole, after, slice(rows, None))
    assert_same_belief(whole.last_belief, after.last_belief)


@pytest.mark.parametrize("structure", STARTS_S)
def test_a_live_tracker_goes_on_from_any_sample(gappy, structure):
    config = oarlock.Config(structure=structure)
    uncut, before = (oarlock.Tracker(sculler(), config=config) for _ in range(2))
    samples = uncut.samples(gappy)
    streamed(uncut, samples)
    streamed(before, samples[:STARTED])
    after = oarlock.Tracker(sculler(), config=config, belief=before.belief)
    streamed(after, samples[STARTED:])
    assert_same_belief(after.belief, uncut.belief)


def test_a_tracker_goes_on_from_a_belief(recording, track):
    before = oarlock.track(sculler(), recording.slice(end_s=CUT_S))
    tracker = oarlock.Tracker(sculler(), belief=before.last_belief)
    steps = streamed(tracker, tracker.samples(recording.slice(start_s=CUT_S)))
    assert {info.status for _, info in steps} == {"tracking"}
    assert_same_belief(tracker.belief, track.last_belief)


def test_same_run_twice(recording, track):
    again = oarlock.track(sculler(), recording)
    assert_same_rows(again, track)
    assert np.array_equal(again.beliefs.covariance, track.beliefs.covariance)
    smooth, smooth_again = oarlock.smooth(track), oarlock.smooth(again)
    assert_same_rows(smooth_again, smooth)


@pytest.mark.parametrize("structure", STARTS_S)
def test_smoothing_leaves_the_last_sample(recording, structure):
    track = oarlock.track(sculler(), recording, config=oarlock.Config(structure=structure))
    smoothed = oarlock.smooth(track)
    assert smoothed.smoothed
    assert not track.smoothed
    # Strapdown links carry estimates from update to update: angles differ by rounding.
    rounding = 1e-12 if structure == "strapdown" else 0.0
    for name in ("q", "qd", "qdd"):
        np.testing.assert_allclose(
            getattr(smoothed, name)[-1], getattr(track, name)[-1], rtol=0, atol=rounding
        )
    # A filtered standard deviation is that of the last update, up to an interval of updates old.
    np.testing.assert_allclose(smoothed.q_std[-1], track.q_std[-1], rtol=0.02 if rounding else 0.0)
    assert not np.array_equal(smoothed.q[:-1], track.q[:-1], equal_nan=True)


@pytest.mark.parametrize(
    ("seen", "late"),
    [(STARTED + 10, 10), (STARTED + 10, STARTED + 8), (STARTED + 10, STARTED + 9), (5, 2)],
    ids=["old", "before_last", "repeated", "starting"],
)
def test_a_late_sample_changes_nothing(recording, seen, late):
    tracker, undisturbed = oarlock.Tracker(sculler()), oarlock.Tracker(sculler())
    samples = tracker.samples(recording)
    streamed(tracker, samples[:seen])
    belief = tracker.belief
    returned, info = tracker.step(samples[late])
    assert (info.status, info.time_s) == ("out_of_order", samples[late].time_s)
    if seen == 5:
        assert belief is returned is None
    else:
        assert_same_belief(returned, belief)
    streamed(tracker, samples[seen : STARTED + 40])
    streamed(undisturbed, samples[: STARTED + 40])
    assert_same_belief(tracker.belief, undisturbed.belief)


@pytest.mark.parametrize("time_s", [np.nan, np.inf, -np.inf])
def test_a_sample_without_a_time_changes_nothing(recording, time_s):
    tracker = oarlock.Tracker(sculler())
    streamed(tracker, tracker.samples(recording)[:STARTED])
    belief = tracker.belief
    returned, info = tracker.step(time_s, {"seat": 0.3})
    assert info.status == "out_of_order"
    assert_same_belief(returned, belief)


QUANTITIES = ("value", "gyro_rad_s", "accel_m_s2", "mag_ut")


@pytest.mark.parametrize("structure", STARTS_S)
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("reading", [np.inf, -np.inf, 1e200, 1e308])
def test_an_infinite_reading_is_refused_and_an_impossible_one_is_not_believed(
    recording, structure, quantity, reading
):
    tracker = oarlock.Tracker(sculler(), config=oarlock.Config(structure=structure))
    samples = tracker.samples(recording)
    streamed(tracker, samples[:STARTED])
    before, readings = tracker.belief, readings_at(recording, STARTED)
    sensor = "seat" if quantity == "value" else "back"
    readings[sensor] = reading if sensor == "seat" else readings[sensor] | {quantity: [reading, 0.0, 0.0]}
    time_s = recording["back"].time_s[STARTED]
    if np.isinf(reading):
        assert_refused(lambda: tracker.step(time_s, readings), "infinite; write NaN")
        assert_same_belief(tracker.belief, before)
        return
    steps = [tracker.step(time_s, readings), *streamed(tracker, samples[STARTED + 1 : STARTED + 20])]
    trunk = before.state_names.index("trunk")
    undisturbed = oarlock.Tracker(sculler(), config=oarlock.Config(structure=structure))
    streamed(undisturbed, samples[: STARTED + 20])
    assert all(np.isfinite(belief.mean).all() for belief, _ in steps)
    assert tracker.belief.mean[trunk] == pytest.approx(undisturbed.belief.mean[trunk], abs=0.05)
    # A step of strapdown links that completes several samples reports the last.
    if structure == "tree":
        assert steps[0][1].sensors[sensor]["rejected"] == (1 if sensor == "seat" else 3)


@pytest.mark.parametrize(
    ("readings", "said"),
    [
        ({"sea": 0.3}, ["sea", "seat"]),
        ({"seat": [0.3, 0.4]}, ["seat", "2", "1"]),
        ({"seat": "far"}, ["seat"]),
        ({"back": {"gyro": [1.0, 2.0, 3.0]}}, ["back", "gyro"]),
        ({"back": {"gyro_rad_s": [1.0, 2.0]}}, ["back.gyro_rad_s", "2", "3"]),
        ({"r_grip": [0.0, 0.0, 0.0]}, ["r_grip"]),
        *(({"r_oar_phi": reading}, ["r_oar_phi"]) for reading in ("far", None, [0.3, 0.4])),
    ],
    ids=str,
)
def test_wrong_readings_are_named(readings, said):
    tracker = oarlock.Tracker(sculler())
    assert_refused(lambda: tracker.sample(0.0, readings), *said)


@pytest.mark.parametrize("reading", ["far", None, [0.3, 0.4]], ids=str)
def test_a_wrong_reading_of_an_input_joint_is_named(reading):
    assert_refused(lambda: oarlock.Tracker(sculler()).sample(0.0, {"r_oar_phi": reading}), "r_oar_phi")


def test_a_belief_of_another_model_is_refused(track):
    with pytest.raises(oarlock.DataError, match="72 states"):
        oarlock.Tracker(oarlock.load_model("pendulum3"), belief=track.last_belief)
