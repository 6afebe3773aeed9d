from pathlib import Path

import numpy as np
import pytest

import oarlock
from oarlock.formats.devices.apdm import read_apdm
from oarlock.recording.gyro_scale import gyro_per_gravity_turn
from oarlock.recording.plausibility import plausibility, require_plausible
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, VectorStream
from oarlock.storage.errors import DataError
from oarlock.storage.units import STANDARD_GRAVITY_M_S2

PENDULUM = Path(__file__).parents[1] / "examples/pendulum/imuData01.csv"
TIME_S = np.arange(1000) / 100.0


def swinging(gyro=1.0, accel=1.0, mag=1.0, amplitude_rad=0.3):
    """A unit that leans to and fro about x in SI units, each quantity times a factor, with noise."""
    rng = np.random.default_rng(3)
    lean, rate = amplitude_rad * np.sin(2.0 * TIME_S), 2.0 * amplitude_rad * np.cos(2.0 * TIME_S)
    zero = np.zeros_like(lean)
    up = np.column_stack([zero, np.cos(lean), -np.sin(lean)])
    gyro_rad_s = np.column_stack([rate, zero, zero]) + 0.01 * rng.standard_normal((1000, 3))
    accel_m_s2 = STANDARD_GRAVITY_M_S2 * up + 0.1 * rng.standard_normal((1000, 3))
    mag_ut = np.array([20.0, 0.0, -40.0]) + rng.standard_normal((1000, 3))
    return {"gyro_rad_s": gyro * gyro_rad_s, "accel_m_s2": accel * accel_m_s2, "mag_ut": mag * mag_ut}


def found(severity, **fields):
    recording = Recording([ImuStream("back", TIME_S, **fields)])
    return [str(f) for f in plausibility(recording) if f.severity == severity]


def test_good_recordings_have_no_finding():
    assert plausibility(Recording([ImuStream("back", TIME_S, **swinging())])) == []
    assert plausibility(read_apdm(PENDULUM)) == []


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ({"accel": 1 / STANDARD_GRAVITY_M_S2}, ["|accel|", "looks like g:", 'unit = "g"']),
        ({"accel": 0.001}, ["|accel|", "0.0098", "divided by 1000"]),
        ({"accel": 1000.0}, ["|accel|", "mm/s2"]),
        ({"accel": 1000 / STANDARD_GRAVITY_M_S2}, ["|accel|", "mg"]),
        ({"accel": 0.0}, ["accel_m_s2 is zero throughout"]),
        ({"gyro": 180 / np.pi, "amplitude_rad": 1.0}, ["|gyro| reaches", "rad/s", "deg/s"]),
        ({"gyro": 180 / np.pi, "amplitude_rad": 0.1}, ["times as fast as gravity", "deg/s"]),
        ({"mag": 0.0}, ["mag_ut is zero throughout"]),
        ({"mag": 0.01}, ["|mag|", "gauss"]),
        ({"mag": 1000.0}, ["|mag|", "nT"]),
        ({"mag": 10.0}, ["|mag|", "mG"]),
        ({"mag": 1e9}, ["|mag|", "mapping file"]),
    ],
)
def test_wrong_units_that_show(factors, words):
    (error,) = found("error", **swinging(**factors))
    assert [word for word in ["back: ", *words] if word not in error] == []


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ({"accel": 0.3}, ["stillest second", "gravity"]),
        ({"mag": 0.05}, ["|mag|", "near 1"]),
        ({"gyro": 0}, ["zero"]),
    ],
)
def test_what_may_be_right_is_a_warning(factors, words):
    assert found("error", **swinging(**factors)) == []
    (warning,) = found("warning", **swinging(**factors))
    assert [word for word in words if word not in warning] == []


def test_errors_are_raised_together():
    stream = ImuStream("back", TIME_S, **swinging(accel=0.1, mag=0.0))
    with pytest.raises(DataError, match=r"(?s)\|accel\|.*mag_ut"):
        require_plausible(Recording([stream]))


@pytest.mark.parametrize("factor", [1.0, 180 / np.pi])
def test_gyro_and_gravity_turn_alike(factor):
    ratio = gyro_per_gravity_turn(ImuStream("back", TIME_S, **swinging(gyro=factor)))
    assert ratio == pytest.approx(factor, rel=0.1)


def test_a_still_unit_does_not_tell_the_gyro_unit():
    assert gyro_per_gravity_turn(ImuStream("back", TIME_S, **swinging(amplitude_rad=0.0))) is None


def test_missing_data_are_notes_and_do_not_hide_units():
    fields = swinging(accel=1 / STANDARD_GRAVITY_M_S2)
    fields["accel_m_s2"][200:400] = np.nan
    fields["mag_ut"][:, 2] = np.nan
    assert "looks like g" in found("error", **fields)[0]
    notes = found("note", **fields)
    assert any(
        "accel_m_s2 is missing in 200 of 1000 samples, longest from 2.000 to 3.990 s" in n for n in notes
    )
    assert any("mag_ut has no z axis" in n for n in notes)


def test_absent_quantities_are_notes():
    fields = {"gyro_rad_s": swinging()["gyro_rad_s"]}
    # The magnetometers of all units are one line of the track.
    assert any(n.endswith("has no accel_m_s2.") for n in found("note", **fields))


def test_a_quantity_without_reading_is_a_warning():
    assert any("all NaN" in w for w in found("warning", gyro_rad_s=np.full((1000, 3), np.nan)))


def test_gap_in_time_is_a_note():
    recording = Recording([ScalarStream("seat", np.concatenate([TIME_S, TIME_S + 12.0]), np.zeros(2000))])
    (note,) = plausibility(recording)
    assert note.severity == "note"
    assert note.message == "200 packets missing in 1 place, longest 2 s at 10.0 s."


def test_scalar_in_another_unit():
    (warning,) = plausibility(Recording([ScalarStream("seat", TIME_S, 300.0 + TIME_S, unit="m")]))
    assert warning.severity == "warning"
    assert "310 m" in warning.message and '"mm"' in warning.message


def test_short_streams_are_judged_too():
    for rows in (1, 2, 3):
        parts = {k: v[:rows] for k, v in swinging(accel=1 / STANDARD_GRAVITY_M_S2).items()}
        recording = Recording(
            [ImuStream("back", TIME_S[:rows], **parts), VectorStream("hand", [0.0], [[0, 0, 0]])]
        )
        assert [f.severity for f in plausibility(recording)] == ["error"]


def test_missing_readings_of_what_the_model_does_not_measure_are_no_notes():
    body = oarlock.load_model("lower_body").with_units(["thigh_r", "shank_r"])
    fields = swinging()
    fields["mag_ut"][200:400] = np.nan
    units = [ImuStream(name, TIME_S, **fields) for name in ("thigh_r", "shank_r")]
    assert any(found.missing == "mag_ut" for found in plausibility(Recording(units)))
    assert not any("mag_ut is missing" in note for note in oarlock.track(body, Recording(units)).notes)
