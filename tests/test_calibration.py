"""A calibration: its files, what it refuses, what it corrects in a recording and leaves alone bit for bit."""

import copy
import math
import pickle

import numpy as np
import pytest

import oarlock
from oarlock import Calibration, Recording
from oarlock.calibration.static.worn_model import Worn
from oarlock.recording import Clock, EncoderScale, ImuStream, ScalarStream, VectorStream
from oarlock.storage.errors import DataError
from refusals import assert_refused

# Correcting what was spoilt is a few roundings of numbers up to 100.
ROUNDING = 1e-12

SOFT_IRON = np.array([[1.05, 0.02, -0.03], [0.01, 0.97, 0.04], [-0.02, 0.03, 1.01]])
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
LEAN = np.array([[np.cos(0.1), -np.sin(0.1), 0.0], [np.sin(0.1), np.cos(0.1), 0.0], [0.0, 0.0, 1.0]])
FULL = {
    "parameters": {"l_b": 1 / 3},
    "mounts": {"back": (LEAN, [0.1, 0.2, 1 / 3])},
    "noted": {"how": "a session"},
    "mag_offsets_ut": {"back": [3.0, -2.0, 1 / 3]},
    "parameter_stds": {"l_b": 0.01},
    "mount_stds_rad": {"back": [0.01, 0.02, 1 / 30]},
    "mount_offset_stds_m": {"back": [0.01, 0.0, 0.02]},
    "gyro_biases_rad_s": {"back": [0.01, -0.02, 1 / 300]},
    "gyro_bias_stds_rad_s": {"back": [1e-4, 1e-4, 1 / 3e4]},
    "accel_biases_m_s2": {"back": [0.1, 0.2, -1 / 3]},
    "accel_scales": {"back": [1.01, 0.99, 1 + 1 / 300]},
    "mag_matrices": {"back": np.linalg.inv(SOFT_IRON)},
    "clocks": {"back": Clock(0.1, 5e-5, 0.001), "seat": Clock(-1 / 3, -2e-5, 1e-3, 1e-6)},
    "encoders": {"seat": EncoderScale(0.1, -1.0)},
}
NO_ARRAYS = {"parameters", "mounts", "noted", "parameter_stds", "clocks", "encoders"}
ARRAYS = [name for name in FULL if name not in NO_ARRAYS]


def true_recording(seed=0):
    rng = np.random.default_rng(seed)
    time_s = np.arange(200) / 100.0
    gyro, accel, mag = rng.normal(size=(3, 200, 3)) * np.array([1.0, 10.0, 40.0])[:, None, None]
    gyro[3], accel[5, 0], mag[7] = np.nan, np.nan, np.nan
    return Recording(
        [
            ImuStream("back", time_s, gyro, accel, mag),
            ImuStream("other", time_s, gyro, accel, mag),
            ScalarStream("seat", time_s, rng.normal(size=200), "m"),
            VectorStream("place", time_s, rng.normal(size=(200, 3))),
        ],
        {"athlete": "A1"},
    )


def spoilt(recording, calibration):
    """What the streams would read, written from the definitions, apart from the code under test."""
    back, other, seat, place = recording.streams
    gyro = back.gyro_rad_s + calibration.gyro_biases_rad_s["back"]
    accel = back.accel_m_s2 * calibration.accel_scales["back"] + calibration.accel_biases_m_s2["back"]
    mag = (
        np.linalg.solve(calibration.mag_matrices["back"], back.mag_ut.T).T
        + calibration.mag_offsets_ut["back"]
    )
    shown = {n: back.time_s + c.offset_s + c.drift * back.time_s for n, c in calibration.clocks.items()}
    encoder = calibration.encoders["seat"]
    return Recording(
        [
            ImuStream("back", shown["back"], gyro, accel, mag),
            other,
            ScalarStream("seat", shown["seat"], seat.value / encoder.scale + encoder.zero, "m"),
            place,
        ],
        recording.meta,
    )


def test_corrected_undoes_every_error():
    calibration, truth = Calibration(**FULL), true_recording()
    found = calibration.corrected(spoilt(truth, calibration))
    for stream, true in zip(found, truth, strict=True):
        np.testing.assert_allclose(stream.time_s, true.time_s, atol=ROUNDING)
        for name, values in true.values.items():
            left = calibration.mag_offsets_ut["back"] if (stream.name, name) == ("back", "mag_ut") else 0.0
            np.testing.assert_allclose(stream.values[name], values + left, atol=100 * ROUNDING)
    assert dict(found.meta) == {"athlete": "A1"}
    assert found["seat"].unit == "m"


@pytest.mark.parametrize("field", ["parameters", "mounts", "noted", "mag_offsets_ut", "mount_stds_rad"])
def test_what_the_engine_takes_leaves_the_recording_as_it_is(field):
    recording = true_recording()
    assert Calibration(**{field: FULL[field]}).corrected(recording) is recording


def test_one_entry_leaves_the_other_quantities_and_streams_bit_for_bit():
    recording = true_recording()
    found = Calibration(gyro_biases_rad_s={"back": [0.1, 0.0, 0.0]}).corrected(recording)
    assert found["back"].gyro_rad_s.tobytes() != recording["back"].gyro_rad_s.tobytes()
    for name in ("accel_m_s2", "mag_ut"):
        assert found["back"].values[name].tobytes() == recording["back"].values[name].tobytes()
    assert found["back"].time_s.tobytes() == recording["back"].time_s.tobytes()
    assert found["other"] is recording["other"]


def test_names_that_the_recording_lacks_are_passed_over():
    recording = true_recording().only(["other", "place"])
    assert Calibration(**FULL).corrected(recording) is recording


@pytest.mark.parametrize("field", ["gyro_biases_rad_s", "accel_scales", "mag_matrices", "encoders"])
def test_an_entry_of_another_kind_of_stream_is_refused(field):
    recording = true_recording()
    name = "back" if field == "encoders" else "seat"
    calibration = Calibration(**{field: {name: next(iter(FULL[field].values()))}})
    with pytest.raises(DataError, match=rf'{field} of "{name}".*not a'):
        calibration.corrected(recording)


def assert_same(one, other):
    for name in ARRAYS:
        have, want = getattr(one, name), getattr(other, name)
        assert {n: v.tobytes() for n, v in have.items()} == {n: v.tobytes() for n, v in want.items()}
    for name in ("parameters", "noted", "parameter_stds", "encoders"):
        assert dict(getattr(one, name)) == dict(getattr(other, name))
    assert repr(dict(one.clocks)) == repr(dict(other.clocks))  # repr, for NaN is no equal
    for unit, mount in other.mounts.items():
        assert [part.tobytes() for part in one.mounts[unit]] == [part.tobytes() for part in mount]


def test_file_pickle_and_copy_give_back_every_bit(tmp_path):
    calibration = Calibration(**FULL)
    calibration.save(tmp_path / "wearing.toml")
    assert_same(oarlock.load_calibration(tmp_path / "wearing.toml"), calibration)
    assert_same(pickle.loads(pickle.dumps(calibration)), calibration)
    assert_same(copy.deepcopy(calibration), calibration)


def test_a_file_holds_no_field_that_is_empty(tmp_path):
    Calibration(parameters={"l_b": 0.5}).save(tmp_path / "wearing.toml")
    text = (tmp_path / "wearing.toml").read_text(encoding="utf-8")
    assert "format = 1" in text
    assert not [name for name in (*ARRAYS, "clocks", "encoders") if name in text]


def test_it_does_not_change():
    calibration = copy.deepcopy(Calibration(**FULL))
    with pytest.raises(TypeError):
        calibration.parameters["l_b"] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        calibration.mounts["back"][0][0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        calibration.mag_offsets_ut["back"][0] = 2.0


def of_back(field, value):
    return Calibration(**{field: {"back": value}})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Calibration({"l_b": math.nan}), ['parameter "l_b"', "nan"]),
        (lambda: Calibration({"l_b": "0.3"}), ['parameter "l_b"', "not real and numeric"]),
        (lambda: of_back("mag_offsets_ut", [1.0, 2.0]), ['mag_offsets_ut of "back"', "(2,)", "(3,)"]),
        (
            lambda: of_back("mag_offsets_ut", [1.0, 2.0, math.nan]),
            ['mag_offsets_ut of "back"', "finite", "uT"],
        ),
        (lambda: of_back("mounts", TURN), ['mount of "back"', "offset_m"]),
        (lambda: of_back("mounts", (2 * TURN, np.zeros(3))), ['mount of "back"', "orthonormal", "3"]),
        (lambda: of_back("mounts", (-TURN, np.zeros(3))), ['mount of "back"', "mirror"]),
        (lambda: of_back("mounts", (TURN, np.zeros(2))), ["offset_m", "(2,)", "(3,)"]),
        (lambda: of_back("mounts", (TURN, [0.0, np.inf, 0.0])), ["offset_m", "finite"]),
        (lambda: of_back("mounts", (np.full((3, 3), np.nan), np.zeros(3))), ["orthonormal"]),
        (lambda: Clock(math.inf), ["offset_s", "inf", "s"]),
        (lambda: Clock("1"), ["offset_s", "'1'", "number"]),
        (lambda: Clock(0.0, 50.0), ["drift", "50", "ppm"]),
        (lambda: Clock(0.0, 0.0, -1.0), ["offset_std_s", "-1", "NaN"]),
        (lambda: EncoderScale(math.nan), ["zero", "nan"]),
        (lambda: EncoderScale(0.0, 0.0), ["scale", "0", "-1"]),
        (lambda: Calibration(parameter_stds={"l_b": -1.0}), ['parameter_stds of "l_b"', "-1"]),
        (lambda: of_back("mount_stds_rad", [0.1, -0.1, 0.1]), ['mount_stds_rad of "back"', "rad"]),
        (lambda: of_back("gyro_biases_rad_s", 0.1), ['gyro_biases_rad_s of "back"', "(3,)"]),
        (lambda: of_back("accel_scales", [1.0, 0.0, 1.0]), ['accel_scales of "back"', "positive"]),
        (lambda: of_back("mag_matrices", -np.eye(3)), ['mag_matrices of "back"', "determinant -1"]),
        (lambda: of_back("mag_matrices", [1, 2, 3]), ['mag_matrices of "back"', "(3, 3)"]),
        (lambda: of_back("clocks", 0.1), ['clocks of "back"', "oarlock.recording.Clock"]),
        (
            lambda: Calibration(encoders={"seat": (0.1, 1.0)}),
            ['encoders of "seat"', "oarlock.recording.EncoderScale"],
        ),
        (lambda: Calibration(clocks=[Clock(0.0)]), ["clocks", "table keyed by name", "list"]),
    ],
)
def test_bad_values(make, words):
    assert_refused(make, *words)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[clocks.back]\noffset_s = 0.1\ndrift = 50.0\n",
            r"wearing.toml:2, table \[clocks.back\].*drift.*50 ppm",
        ),
        ("[encoders.seat]\nscale = -1.0\n", '"zero" is missing'),
        (
            "[mounts.back]\nrotaton = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n",
            r'wearing.toml:3, key "rotaton" of \[mounts.back\].*"rotation"',
        ),
    ],
)
def test_a_mistake_in_a_file_names_its_line(tmp_path, text, said):
    (tmp_path / "wearing.toml").write_text(f"format = 1\n{text}")
    with pytest.raises(DataError, match=said):
        oarlock.load_calibration(tmp_path / "wearing.toml")


# --- on the way into the engine ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swing():
    model = oarlock.load_model("arm7")
    time_s = np.arange(0.0, 3.0, 0.01)
    q = 0.4 * np.sin(time_s[:, None] * np.linspace(1.0, 2.0, len(model.joint_names)))
    _, recording = oarlock.simulate(model, oarlock.simulation.Motion(model.joint_names, time_s, q), seed=1)
    return model, recording


def bad_of(recording):
    """Every unit with a gyro bias, a late clock and soft iron; and the calibration that tells them."""
    names = [s.name for s in recording if isinstance(s, ImuStream)]
    bias, offset = np.array([0.05, -0.03, 0.02]), np.array([5.0, -4.0, 3.0])
    streams = [
        ImuStream(
            s.name,
            s.time_s + 0.25,
            s.gyro_rad_s + bias,
            s.accel_m_s2,
            None if s.mag_ut is None else s.mag_ut @ SOFT_IRON.T + offset,
        )
        for s in recording
        if isinstance(s, ImuStream)
    ]
    calibration = Calibration(
        gyro_biases_rad_s=dict.fromkeys(names, bias),
        mag_offsets_ut=dict.fromkeys(names, offset),
        mag_matrices=dict.fromkeys(names, np.linalg.inv(SOFT_IRON)),
        clocks=dict.fromkeys(names, Clock(0.25)),
    )
    return Recording(streams), calibration


# The filter's own answer may move by what rounding does to a reading, times its slopes.
SAME_RAD = 1e-7


def test_track_sees_the_corrected_recording_and_says_so(swing):
    model, clean = swing
    bad, calibration = bad_of(clean)
    plain, mended = oarlock.track(model, clean), oarlock.track(model, bad, calibration)
    np.testing.assert_allclose(mended.q, plain.q, atol=SAME_RAD)
    told = " ".join(mended.notes)
    for words in ("gyroscope biases of", "soft iron of", "clocks of", "magnetometer offsets of"):
        assert words in told
    assert mended.provenance["recording_sha256"] == oarlock.track(model, bad).provenance["recording_sha256"]


def test_many_are_tracked_as_each_alone(swing):
    model, clean = swing
    bad, calibration = bad_of(clean)
    alone = oarlock.track(model, bad, calibration)
    one, other = oarlock.track_many(model, [bad, clean], [calibration, None])
    assert one.q.tobytes() == alone.q.tobytes()
    assert one.notes == alone.notes
    assert other.q.tobytes() == oarlock.track(model, clean).q.tobytes()


def test_a_calibration_without_corrections_changes_no_bit(swing):
    model, clean = swing
    bare = oarlock.track(model, clean, Calibration())
    assert bare.q.tobytes() == oarlock.track(model, clean).q.tobytes()


# --- carried on by the searches ------------------------------------------------------------------------


def test_searches_carry_everything_on_but_the_deviations_of_what_they_replace():
    model = oarlock.load_model("arm7")
    unit, other, *_ = (s.name for s in model.describe().inertial_units)
    name = next(iter(model.parameters))
    before = Calibration(
        **{k: {unit: next(iter(v.values()))} for k, v in FULL.items() if k not in ("parameters", "noted")}
        | {"parameter_stds": {name: 0.01}, "parameters": {name: model.parameters[name]}}
        | {"mount_stds_rad": {unit: [0.1] * 3, other: [0.2] * 3}}
    )
    worn = Worn.of(model, before)
    found = worn.calibrated({unit: (TURN, worn.offsets[unit])}, {"how": "a test"})
    assert set(found.mount_stds_rad) == {other}  # the unit was turned anew
    assert set(found.mount_offset_stds_m) == {unit}
    assert dict(found.parameter_stds) == {name: 0.01}
    arrays = ("gyro_biases_rad_s", "accel_biases_m_s2", "accel_scales", "mag_matrices")
    for field in (*arrays, "clocks", "encoders"):
        assert dict(getattr(found, field)).keys() == {unit}
    assert not worn.calibrated({}, {}, {name: 0.5}).parameter_stds
