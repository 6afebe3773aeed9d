"""With a session's whole calibration a live tracker gives the same bits as the track of the recording as measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from exact_recording import ENCODERS, UNITS, load_excerpt, sculler
from test_live import STARTED, assert_same_belief, assert_step_is_row, readings_at

SPAN_S = 3.0
LOGGER = ("back", "r_upperarm", "r_forearm")
"""Units with a clock of their own."""

CORRECTED_RAD = 1e-6
"""Readings that were spoilt and corrected differ from the true ones by rounding, which the filter may amplify."""


def of_units(number: float, three: tuple[float, float, float]) -> dict[str, list[float]]:
    """Another one for each unit."""
    return {unit: [number + (1 + i) * x for x in three] for i, unit in enumerate(UNITS)}


def mounts() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The model's, each turned and moved a little."""
    nominal = {s.name: s.mount for s in sculler().describe().inertial_units}
    turn = Rotation.from_rotvec([0.002, -0.001, 0.003]).as_matrix()
    return {n: (np.asarray(m.rotation) @ turn, np.asarray(m.offset) + 1e-3) for n, m in nominal.items()}


@pytest.fixture(scope="module")
def calibration() -> oarlock.Calibration:
    iron = np.array([[1.05, 0.02, -0.03], [0.01, 0.97, 0.04], [-0.02, 0.03, 1.01]])
    logger, boat = (
        oarlock.recording.Clock(0.137, 5e-5, 1e-3, 1e-6),
        oarlock.recording.Clock(-1 / 3, -2e-5),
    )
    return oarlock.Calibration(
        parameters={"l_b": 0.521, "l_ua_r": 0.314},
        mounts=mounts(),
        mag_offsets_ut=of_units(0.0, (3.0, -2.0, 1 / 3)),
        parameter_stds={"l_b": 0.01},
        mount_stds_rad=of_units(0.01, (0.001, 0.002, 0.0)),
        mount_offset_stds_m=of_units(0.01, (0.0, 0.001, 0.002)),
        gyro_biases_rad_s=of_units(0.0, (0.01, -0.02, 1 / 300)),
        accel_biases_m_s2=of_units(0.0, (0.1, 0.2, -1 / 3)),
        accel_scales=of_units(1.0, (0.01, -0.01, 1 / 300)),
        mag_matrices={unit: np.linalg.inv(iron + 0.01 * i) for i, unit in enumerate(UNITS)},
        clocks=dict.fromkeys(LOGGER, logger) | dict.fromkeys(ENCODERS, boat),
        encoders={
            name: oarlock.recording.EncoderScale(0.1 + 0.01 * i, -1.02) for i, name in enumerate(ENCODERS)
        },
    )


@pytest.fixture(scope="module")
def true() -> oarlock.Recording:
    return load_excerpt().recording.slice(end_s=SPAN_S)


@pytest.fixture(scope="module")
def measured(true: oarlock.Recording, calibration: oarlock.Calibration) -> oarlock.Recording:
    """What the streams would read, written from the definitions."""
    return oarlock.Recording([spoilt(stream, calibration) for stream in true], true.meta)


def spoilt(stream: oarlock.Stream, known: oarlock.Calibration) -> oarlock.Stream:
    name = stream.name
    clock = known.clocks.get(name)
    time_s = stream.time_s if clock is None else stream.time_s + clock.offset_s + clock.drift * stream.time_s
    if isinstance(stream, oarlock.recording.ScalarStream):
        encoder = known.encoders[name]
        return oarlock.recording.ScalarStream(
            name, time_s, stream.value / encoder.scale + encoder.zero, stream.unit
        )
    gyro = stream.gyro_rad_s + known.gyro_biases_rad_s[name]
    accel = stream.accel_m_s2 * known.accel_scales[name] + known.accel_biases_m_s2[name]
    mag = np.linalg.solve(known.mag_matrices[name], stream.mag_ut.T).T + known.mag_offsets_ut[name]
    return oarlock.recording.ImuStream(name, time_s, gyro, accel, mag)


@pytest.fixture(scope="module")
def track(measured, calibration) -> oarlock.Track:
    return oarlock.track(sculler(), measured, calibration)


def test_stream_equals_batch(measured, calibration, track):
    tracker = oarlock.Tracker(sculler(), calibration)
    steps = [tracker.step(sample) for sample in tracker.samples(measured)]
    assert [info.time_s for _, info in steps] == list(track.time_s)
    started = next(i for i, (belief, _) in enumerate(steps) if belief is not None)
    for row in range(started, len(steps)):
        assert_step_is_row(steps[row], track, row)
    assert_same_belief(tracker.belief, track.last_belief)


def test_readings_and_stamps_of_a_live_program_give_the_same_bits(measured, calibration, track):
    tracker = oarlock.Tracker(sculler(), calibration)
    for row in range(len(measured["seat"])):
        times_s = [tracker.corrected_time_s(s.name, s.time_s[row]) for s in measured.streams]
        tracker.step(min(times_s), readings_at(measured, row))
    assert_same_belief(tracker.belief, track.last_belief)


def test_side_by_side_gives_the_same_bits(measured, calibration, track):
    (other,) = oarlock.track_many(sculler(), [measured], calibration)
    assert np.array_equal(other.q, track.q, equal_nan=True)
    assert_same_belief(other.last_belief, track.last_belief)


def test_what_is_corrected_tracks_as_what_was_right(true, calibration, track):
    right = oarlock.track(sculler(), true, replace(calibration.for_corrected(), mag_offsets_ut={}))
    assert right.time_s == pytest.approx(track.time_s, abs=1e-12)
    for one, other in ((right, track), (oarlock.smooth(right), oarlock.smooth(track))):
        np.testing.assert_allclose(one.q, other.q, atol=CORRECTED_RAD)
        np.testing.assert_allclose(one.q_std, other.q_std, rtol=CORRECTED_RAD, atol=CORRECTED_RAD)


def test_without_corrections_the_same_readings_lead_astray(measured, calibration, track):
    units = measured.only(["l_upperarm", "l_forearm"])
    blind = oarlock.track(sculler(), units, calibration.for_corrected())
    corrected = oarlock.track(sculler(), units, calibration)
    assert np.nanmax(np.abs(blind.q - corrected.q)) > 100 * CORRECTED_RAD


def test_a_clock_of_no_stream_is_named(calibration):
    tracker = oarlock.Tracker(sculler(), calibration)
    assert tracker.corrected_time_s("back", 0.137) == 0.0
    assert oarlock.Tracker(sculler()).corrected_time_s("back", 1.5) == 1.5
    with pytest.raises(oarlock.DataError, match=r"no stream 'bac'.*back"):
        tracker.corrected_time_s("bac", 0.0)


@pytest.mark.parametrize(("reading", "fault"), [(12.0, "clipped"), (11.6, "none"), (-12.0, "clipped")])
def test_the_end_of_a_range_is_where_the_sensor_has_it(true, reading, fault):
    """A reading of 12 m/s2 is at the end of that range, whatever the calibration makes of it."""
    text = sculler().text.replace("gyro_std_rad_s", "accel_range_m_s2 = 12.0\ngyro_std_rad_s")
    known = oarlock.Calibration(accel_scales={"back": [1.05, 1.05, 1.05]})
    tracker = oarlock.Tracker(oarlock.Model.from_toml(text, "sculler.toml", {}), known)
    for sample in tracker.samples(true)[:STARTED]:
        tracker.step(sample)
    readings = readings_at(true, STARTED)
    readings["back"]["accel_m_s2"] = [reading, 0.0, 0.0]
    _, info = tracker.step(true["back"].time_s[STARTED], readings)
    assert info.sensors["back"]["fault"] == fault
