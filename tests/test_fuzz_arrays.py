"""Arrays of any kind at every gate: held exactly, or refused with a reason."""

import numpy as np
import pytest
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import oarlock
from fuzz_campaign import answered, campaign
from oarlock.storage.array_gate import real_array, time_array

DTYPES = st.one_of(
    hnp.floating_dtypes(endianness="?", sizes=(16, 32, 64)),
    hnp.integer_dtypes(endianness="?"),
    hnp.unsigned_integer_dtypes(endianness="?"),
    hnp.boolean_dtypes(),
    hnp.complex_number_dtypes(endianness="?"),
    hnp.datetime64_dtypes(),
    hnp.timedelta64_dtypes(),
    hnp.byte_string_dtypes(max_len=4),
    hnp.unicode_string_dtypes(max_len=4),
    st.sampled_from([np.dtype(np.longdouble), np.dtype(object), np.dtype([("a", "f8")]), np.dtype("V3")]),
)


@st.composite
def any_arrays(draw, most=12):
    """Any dtype, byte order, shape with zeros, strides, sub-class and mask."""
    dtype = draw(DTYPES)
    shape = draw(hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=most))
    if dtype.kind in "OV" or dtype == np.longdouble:
        array = np.zeros(shape, dtype)
        if dtype.kind == "O":
            array[...] = draw(
                st.sampled_from([None, "x", 1, 2.5, 1 + 2j, 10**400, [1]]) if shape else st.just(7)
            )
        elif dtype == np.longdouble:
            array[...] = draw(st.sampled_from(["0.1", "1e4000", "nan", "3"]))
    else:
        array = draw(hnp.arrays(dtype, shape))
    layout = draw(
        st.sampled_from(["as is", "fortran", "reversed", "every second", "broadcast", "transposed", "matrix"])
    )
    if layout == "fortran":
        array = np.asfortranarray(array)
    elif layout == "reversed" and array.ndim:
        array = array[::-1]
    elif layout == "every second" and array.ndim:
        array = array[..., ::2]
    elif layout == "broadcast":
        array = np.broadcast_to(array, (2, *array.shape))
    elif layout == "transposed":
        array = array.T
    elif layout == "matrix" and array.ndim == 2:
        array = array.view(np.recarray)
    if draw(st.booleans()) and array.dtype.kind not in "OV":
        array = np.ma.array(array, mask=draw(hnp.arrays(bool, array.shape)))
    return array


SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.complex_numbers(),
    st.text(max_size=4),
    st.binary(max_size=4),
    st.sampled_from([b"1", range(3), 10**400, np.float64]),
    st.builds(object),
    st.builds(dict),
    st.just({1}),
)
HASHABLE = SCALARS.filter(lambda thing: type(thing).__hash__ is not None)
THINGS = (
    any_arrays() | SCALARS | st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4), max_leaves=8)
)
SHAPES = st.lists(st.none() | st.integers(0, 4), max_size=3).map(tuple)


def check_gate(thing, shape):
    if isinstance(thing, np.ndarray):
        shape = thing.shape
    result = answered(lambda: real_array(thing, shape, "thing"))
    if result is None:
        return
    assert result.dtype == np.float64 and result.flags.c_contiguous and not result.flags.writeable
    hidden = (
        np.ma.getmaskarray(thing) if isinstance(thing, np.ma.MaskedArray) else np.zeros(result.shape, bool)
    )
    assert np.isnan(result[hidden]).all()
    given = np.asarray(thing)[~hidden] if isinstance(thing, np.ndarray) else np.asarray(thing)
    np.testing.assert_array_equal(result[~hidden].reshape(given.shape).astype(given.dtype), given)


def test_the_gate_holds_exactly_or_refuses():
    campaign(check_gate, THINGS, SHAPES)


def check_stamps(thing):
    time_s = answered(lambda: time_array(thing, "thing"))
    assert time_s is None or (time_s.size and np.isfinite(time_s).all() and (np.diff(time_s) > 0).all())


def test_stamps_increase_or_are_refused():
    campaign(check_stamps, THINGS)


MODEL = oarlock.load_model("pendulum3")


def check_kinematics(q, qd):
    """The gate of the compiled module; a refusal there may be a TypeError, as for any wrong argument."""
    poses = answered(lambda: MODEL.forward_kinematics(q))
    assert poses is None or poses.shape[-2:] == (4, 4)
    answered(lambda: MODEL.predict_measurements(q, qd, qd))
    if poses is not None:
        width = len(MODEL.coordinate_names)
        given = real_array(q, np.shape(q), "q").reshape(-1, width)
        plain = answered(lambda: MODEL.forward_kinematics(np.array(given)))
        np.testing.assert_array_equal(poses.reshape(plain.shape), plain)


@st.composite
def postures(draw):
    """Nearly always of a width that the model takes."""
    dtype = draw(
        hnp.floating_dtypes(endianness="?", sizes=(16, 32, 64))
        | hnp.integer_dtypes(endianness="?")
        | st.just(np.dtype(bool))
    )
    shape = (*draw(hnp.array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=3)), 3)
    array = draw(hnp.arrays(dtype, shape))
    if draw(st.booleans()):
        array = np.asfortranarray(array)[..., ::-1]
    if draw(st.booleans()):
        array = np.ma.array(array, mask=draw(hnp.arrays(bool, array.shape)))
    return array


def test_compiled_kinematics_take_any_array():
    campaign(check_kinematics, postures() | THINGS, postures() | THINGS)


def check_streams(name, time_s, first, second, kind):
    def build():
        if kind == "imu":
            return oarlock.recording.ImuStream(name, time_s, gyro_rad_s=first, accel_m_s2=second)
        if kind == "vector":
            return oarlock.recording.VectorStream(name, time_s, first)
        return oarlock.recording.ScalarStream(
            name, time_s, first, second if isinstance(second, str) else None
        )

    stream = answered(build)
    if stream is None:
        return
    repr(stream)
    assert all(len(rows) == len(stream) for rows in stream.values.values())
    recording = answered(lambda: oarlock.Recording([stream, second]))
    recording = recording or oarlock.Recording([stream])
    repr(recording)
    answered(lambda: oarlock.track(MODEL, recording))


@st.composite
def rows_of(draw, count):
    width = draw(st.sampled_from([(), (3,), (3,), (1,), (0,)]))
    return draw(hnp.arrays(np.float64, (count, *width), elements=st.floats(width=64)))


@st.composite
def streams(draw):
    """Arguments of a stream; often right in all but one thing."""
    count = draw(st.integers(0, 6))
    steps = draw(
        st.lists(st.floats(1e-6, 1e3) | st.sampled_from([0.0, -1.0, 1e300]), min_size=count, max_size=count)
    )
    time_s = draw(st.just(np.cumsum(steps)) | THINGS)
    first, second = draw(rows_of(count) | THINGS), draw(rows_of(count) | THINGS)
    name = draw(st.sampled_from(["lower", "", " ", "upper", "é\x00"]) | SCALARS)
    return name, time_s, first, second, draw(st.sampled_from(["imu", "scalar", "vector"]))


def test_streams_are_held_and_tracked_or_refused():
    campaign(lambda given: check_streams(*given), streams())


def check_samples(time_s, readings):
    tracker = oarlock.Tracker(MODEL)
    for offset in range(3):
        answered(
            lambda offset=offset: tracker.step(
                time_s + offset if isinstance(time_s, float) else time_s, readings
            ),
            (TypeError,),
        )
    answered(lambda: oarlock.Tracker(MODEL).sample(time_s, readings), (TypeError,))


FIELDS = st.sampled_from(["gyro_rad_s", "accel_m_s2", "mag_ut", "value", "x"])
READINGS = st.dictionaries(
    st.sampled_from([*MODEL.sensor_names, "nobody", ""]) | HASHABLE,
    THINGS | st.dictionaries(FIELDS, THINGS | st.just((1.0, 2.0, 3.0)), max_size=3),
    max_size=3,
)


def test_samples_of_a_live_tracker():
    campaign(check_samples, st.floats() | THINGS, READINGS)


@pytest.mark.parametrize("size", [0, 1, 1_000_000])
def test_sizes(size):
    assert real_array(np.zeros((size, 3), ">f4"), (None, 3), "many").shape == (size, 3)
