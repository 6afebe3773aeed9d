import copy
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import oarlock
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, VectorStream
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.storage.array_gate import real_array
from oarlock.storage.errors import DataError
from refusals import assert_refused

TIME_S = np.arange(5) / 100.0
ROWS = np.arange(15.0).reshape(5, 3)


def imu(name="back", **fields):
    return ImuStream(name, TIME_S, **(fields or {"gyro_rad_s": ROWS}))


# --- the gate ---------------------------------------------------------------------------------------------


@given(
    hnp.arrays(
        st.sampled_from(["f2", "f4", ">f4", "f8", ">f8", "i1", "u2", "i4", ">i4", "u4"]),
        st.tuples(st.integers(1, 6), st.just(3)),
        elements=None,
    ),
    st.sampled_from(["C", "F", "reversed", "strided", "transposed", "read-only"]),
)
def test_gate_keeps_every_value_in_any_dtype_and_layout(values, layout):
    with np.errstate(all="ignore"):
        expected = np.array(values.tolist(), dtype=np.float64)
    given_array = {
        "C": lambda: np.ascontiguousarray(values),
        "F": lambda: np.asfortranarray(values),
        "reversed": lambda: values[::-1].copy()[::-1],
        "strided": lambda: np.repeat(values, 2, axis=0)[::2],
        "transposed": lambda: values.T.copy().T,
        "read-only": lambda: np.broadcast_to(values, values.shape),
    }[layout]()
    result = real_array(given_array, (None, 3), "x")
    np.testing.assert_array_equal(result, expected)
    assert result.dtype == np.float64
    assert result.flags.c_contiguous
    assert not result.flags.writeable


def test_gate_copies():
    mine = ROWS.copy()
    stream = imu(gyro_rad_s=mine)
    mine[:] = 0.0
    np.testing.assert_array_equal(stream.gyro_rad_s, ROWS)
    with pytest.raises(ValueError, match="read-only"):
        stream.gyro_rad_s[0, 0] = 1.0


def test_gate_takes_lists_and_exact_long_doubles():
    assert real_array([[1, 2, 3]], (None, 3), "x").tolist() == [[1.0, 2.0, 3.0]]
    assert real_array(ROWS.astype(np.longdouble), (5, 3), "x").tolist() == ROWS.tolist()


def test_nobody_looks_at_what_a_mask_hides():
    hidden = np.ma.masked_array(np.full((5, 3), 2**53 + 1), mask=True)
    assert np.isnan(real_array(hidden, (5, 3), "x")).all()


def test_masked_entries_are_missing():
    masked = np.ma.masked_array(ROWS, mask=ROWS == 4.0)
    assert np.isnan(imu(gyro_rad_s=masked).gyro_rad_s[1, 1])


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (ROWS.astype(complex), ["complex128", "real part"]),
        (ROWS.astype(object), ["object", "NaN instead of None"]),
        (ROWS.astype(str), ["not real and numeric"]),
        (ROWS > 3, ["bool"]),
        (ROWS.astype("M8[s]"), ["datetime64", "seconds as floats"]),
        ([[1.0, 2.0, 3.0], [1.0, 2.0]], ["rows of equal length"]),
        (ROWS[:, :2], ["(5, 2)", "(T, 3)"]),
        (ROWS[:4].T, ["(3, 4)", "(T, 3)", "Transpose"]),
        (np.float64(1.0), ["()", "(T, 3)"]),
        (np.full((5, 3), 2**53 + 1), ["9007199254740993", "exactly"]),
        (ROWS.astype(np.longdouble) * np.longdouble(10.0) ** 4000, ["e+4000", "exactly"]),
    ],
)
def test_gate_names_stream_and_field(values, words):
    assert_refused(lambda: imu(accel_m_s2=values), 'stream "back", accel_m_s2', *words)


# --- streams ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time_s", "words"),
    [
        ([0.0, 0.01, 0.03, 0.02, 0.04], ["time_s[3]", "0.02 s", "0.03 s", "sort"]),
        ([0.0, 0.01, 0.02, 0.02, 0.04], ["time_s[3]", "repeats", "0.02 s", "more digits"]),
        ([0.0, np.nan, 0.02, 0.03, 0.04], ["time_s[1]", "nan", "finite"]),
        ([0.0, 0.01, 0.02, 0.03, np.inf], ["time_s[4]", "inf"]),
        ([], ["no samples"]),
    ],
)
def test_bad_stamps(time_s, words):
    assert_refused(lambda: ImuStream("back", np.array(time_s), gyro_rad_s=ROWS), 'stream "back"', *words)


def test_rows_of_other_length_name_both():
    short = ('stream "back", mag_ut', "4 rows", "time_s has 5")
    assert_refused(lambda: imu(gyro_rad_s=ROWS, mag_ut=ROWS[:4]), *short)


def test_nan_is_missing_and_infinity_is_refused():
    rows = ROWS.copy()
    rows[2, 1] = np.nan
    assert imu(gyro_rad_s=rows).missing_share == pytest.approx(1 / 15)
    rows[3, 2] = -np.inf
    assert_refused(lambda: imu(gyro_rad_s=rows), "gyro_rad_s[3, 2] is -inf at 0.03 s")


def test_a_recording_has_at_most_2000_streams():
    streams = [ScalarStream(f"s{k}", TIME_S, TIME_S) for k in range(2001)]
    assert len(Recording(streams[:2000])) == 2000
    assert_refused(lambda: Recording(streams), "has 2,001 streams; at most 2,000 are kept")


def test_imu_without_quantity():
    assert_refused(lambda: ImuStream("back", TIME_S), "no gyro_rad_s, accel_m_s2 or mag_ut")


def test_stream_name_must_be_text():
    assert_refused(lambda: imu(name=" "), "name")
    assert_refused(lambda: imu(name=7), "7")


def test_scalar_unit():
    assert ScalarStream("seat", TIME_S, ROWS[:, 0], unit="m").unit == "m"
    assert_refused(lambda: ScalarStream("oar", TIME_S, ROWS[:, 0], unit="deg"), "unit is 'deg'")


def test_rate_is_that_of_the_median_step():
    stream = ScalarStream("seat", [0.0, 0.01, 0.02, 0.5, 0.51], ROWS[:, 0])
    assert stream.rate_hz == pytest.approx(100.0)
    assert np.isnan(ScalarStream("seat", [0.0], [1.0]).rate_hz)


# --- recordings -------------------------------------------------------------------------------------------


def trial():
    return Recording(
        [imu(), ScalarStream("seat", TIME_S + 0.02, ROWS[:, 0]), VectorStream("wrist", TIME_S[:1], ROWS[:1])],
        {"athlete": "A07"},
    )


def test_recording_finds_streams_by_name():
    recording = trial()
    assert recording.names == ("back", "seat", "wrist")
    assert recording["seat"] is recording.sensor("seat") is recording.streams[1]
    assert "back" in recording and "bow" not in recording
    assert_refused(lambda: recording["baak"], 'no stream "baak"', 'Did you mean "back"?')
    assert (recording.start_s, recording.end_s) == (0.0, pytest.approx(0.06))


def test_recording_needs_streams_of_different_names():
    assert_refused(lambda: Recording([]), "empty")
    assert_refused(lambda: Recording([imu(), imu()]), 'two streams have the name "back"')
    assert_refused(lambda: Recording([ROWS]), "streams[0] is a ndarray")


def test_recording_does_not_change():
    recording = trial()
    with pytest.raises(AttributeError):
        recording.streams = ()
    with pytest.raises(TypeError):
        recording.meta["athlete"] = "B"


@pytest.mark.parametrize("again", [copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))])
def test_copies_are_equal_and_read_only(again):
    recording = trial()
    twin = again(recording)
    assert repr(twin) == repr(recording)
    assert twin.meta == recording.meta
    assert twin["back"].gyro_rad_s.tobytes() == recording["back"].gyro_rad_s.tobytes()
    assert not twin["back"].gyro_rad_s.flags.writeable


def test_slices_share_no_sample_and_lose_none():
    recording = trial()
    before, after = recording.slice(end_s=0.03), recording.slice(start_s=0.03)
    assert before.names == ("back", "seat", "wrist")
    assert after.names == ("back", "seat")
    joined = np.concatenate([before["back"].gyro_rad_s, after["back"].gyro_rad_s])
    np.testing.assert_array_equal(joined, ROWS)
    assert after.meta == recording.meta
    assert_refused(lambda: recording.slice(1.0, 2.0), "0 to 0.06 s")


def test_repr_tells_what_is_there():
    text = repr(trial())
    for word in ["3 streams", "back", "100 Hz", "5 samples", "0.0 % missing", "gyro_rad_s"]:
        assert word in text
    assert "one sample" in repr(trial()["wrist"])


def test_nobody_can_write_to_a_recording():
    rows = imu().gyro_rad_s
    with pytest.raises(ValueError):
        rows.flags.writeable = True
    assert rows.flags.aligned and rows.flags.c_contiguous


@pytest.mark.parametrize(
    "layout", [np.asfortranarray, np.array, lambda rows: np.repeat(rows, 2, axis=0)[::2]]
)
def test_the_engine_reads_any_layout_alike(layout):
    """It reads a recording's own arrays where they lie and copies all others."""
    model = oarlock.load_model("sculler")
    _, recording = simulate_sculling(model, "B-B", 1.5, seed=1)
    foreign = [SimpleNamespace(**vars(s)) for s in recording]
    for stream in foreign:
        for name in set(vars(stream)) & {"time_s", "value", "gyro_rad_s", "accel_m_s2", "mag_ut"}:
            setattr(stream, name, layout(getattr(stream, name)))
    tracker = oarlock.Tracker(model)
    own, others = tracker.samples(recording), tracker.samples(SimpleNamespace(streams=foreign))
    live = oarlock.Tracker(model)
    assert [s.time_s for s in own] == [s.time_s for s in others]
    for a, b in zip(own, others, strict=True):
        tracker.step(a)
        live.step(b)
    assert np.array_equal(tracker.belief.mean, live.belief.mean)


def test_the_compiled_gate_holds_exactly_or_refuses_as_the_other_does():
    """Found by fuzzing: masked values passed as if they had been seen, large whole numbers were rounded."""
    model = oarlock.load_model("pendulum3")
    poses = model.forward_kinematics(np.ma.array([0.1, 9.0, 0.2], mask=[False, True, False]))
    assert np.isnan(poses[-1, :3, :3]).any()
    np.testing.assert_array_equal(poses[1], model.forward_kinematics([0.1, 0.0, 0.2])[1])
    assert_refused(lambda: model.forward_kinematics(np.array([0, 1, 2**53 + 1])), "9007199254740993")
    assert_refused(lambda: model.forward_kinematics(np.array([True, False, True])), "bool")


@pytest.mark.parametrize("time_s", [10**400, b"", [1.0, 2.0], "soon"])
def test_a_live_stamp_that_is_no_number_is_refused(time_s):
    tracker = oarlock.Tracker(oarlock.load_model("pendulum3"))
    with pytest.raises(DataError, match="time_s"):
        tracker.sample(time_s, {})
