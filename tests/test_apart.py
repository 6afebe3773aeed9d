"""Sensors that do not tick together: every joint in every row, live delivery in any order, streams nobody knows."""

from importlib import resources

import numpy as np
import pytest

import oarlock
from oarlock import rowing
from oarlock_lab.bench.apart import COMMON_HZ, JITTER_S, RATES_HZ, recorded
from refusals import assert_refused


@pytest.fixture(scope="module")
def rowed(sculler):
    motion = rowing.sculling(sculler, 4.0, 24, surge=False, seed=2)
    return recorded(sculler, motion, RATES_HZ, seed=2, jitter_s=JITTER_S)


@pytest.fixture(scope="module")
def rowed_track(sculler, rowed):
    return oarlock.track(sculler, rowed)


def test_every_joint_has_an_estimate_in_every_row(rowed_track):
    for values in (rowed_track.q, rowed_track.q_std, oarlock.smooth(rowed_track).q):
        assert np.isfinite(values).all()
    steps = np.diff(rowed_track.time_s) * 286
    np.testing.assert_allclose(steps, 1, atol=1e-9)
    feathering = rowed_track.coordinate_names.index("r_oar_theta")
    assert not rowed_track.observed[:, feathering].any()
    # It stays at its rest with its prior: a quarter of its soft range.
    np.testing.assert_allclose(rowed_track.q_std[:, feathering], np.deg2rad(240) / 4)
    assert rowed_track.observed[:, rowed_track.coordinate_names.index("r_oar_phi")].all()


def test_a_track_keeps_what_was_found_and_can_be_made_again(sculler, rowed, rowed_track, tmp_path):
    found = rowed_track.provenance["config"]
    assert (found["sample_rate_hz"], found["output_rate_hz"]) == (286.0, 286.0)
    assert found["inputs"] == ["r_oar_theta", "l_oar_theta"]
    # Jitter of 1 ms; the median of its neighbours' differences scatters by a tenth with 80 readings.
    assert found["stamp_std_s"]["r_oar_phi"] == pytest.approx(1e-3, rel=0.4)
    rowed_track.save(tmp_path)
    again = oarlock.load_track(tmp_path).provenance["config"]
    second = oarlock.track(sculler, rowed, config=oarlock.Config(**again))
    np.testing.assert_array_equal(second.q, rowed_track.q)


def test_rows_come_at_the_rate_that_is_asked_for(sculler, rowed):
    slow = oarlock.track(sculler, rowed, config=oarlock.Config(output_rate_hz=25))
    np.testing.assert_allclose(slow.time_s * 25, np.round(slow.time_s * 25), atol=1e-9)
    assert np.isfinite(slow.q).all()


@pytest.fixture(scope="module")
def alternating():
    """Two of three units read between the readings of the first, and no row of 50 Hz falls on a reading."""
    model = oarlock.load_model("pendulum3")
    knots = np.arange(0.0, 4.0, 0.02)
    q = 0.6 * np.sin(2 * np.pi * np.outer(knots, [0.7, 0.9, 1.1]))
    motion = oarlock.simulation.Motion(tuple(model.coordinate_names), knots, q)
    _, recording = oarlock.simulate(model, motion, seed=4, rate_hz=100.0)
    streams = []
    for number, stream in enumerate(recording.streams):
        rows = slice(int(number > 0), None, 2)
        values = {name: value[rows] for name, value in stream.values.items()}
        streams.append(oarlock.recording.ImuStream(stream.name, stream.time_s[rows] + 0.003, **values))
    return model, oarlock.Recording(streams)


def test_rows_between_instants_come_at_a_clean_rate_and_change_no_estimate(alternating):
    model, recording = alternating
    track = oarlock.track(model, recording, config=oarlock.Config(structure="tree"))
    found = track.provenance["config"]
    assert (found["sample_rate_hz"], found["output_rate_hz"]) == (0.0, 50.0)
    np.testing.assert_allclose(np.diff(track.time_s) * 50, 1, atol=1e-9)
    assert np.isfinite(oarlock.smooth(track).q).all()
    every = oarlock.track(model, recording, config=oarlock.Config(**{**found, "output_rate_hz": 0.0}))
    assert not np.isin(np.round(track.time_s, 6), np.round(every.time_s, 6)).any()
    # A prediction in two parts is the same up to rounding, and so is what is learnt from it.
    np.testing.assert_allclose(track.last_belief.mean, every.last_belief.mean, atol=1e-7)


def test_a_live_tracker_gives_the_rows_between_instants(alternating):
    model, recording = alternating
    track = oarlock.track(model, recording)
    tracker = oarlock.Tracker(model, config=oarlock.Config(**track.provenance["config"]))
    rng, given = np.random.default_rng(2), []
    readings = [(s.time_s[k] + rng.uniform(0, 0.025), s, k) for s in recording.streams for k in range(len(s))]
    for _, stream, row in sorted(readings, key=lambda reading: reading[0]):
        values = {name: value[row] for name, value in stream.values.items()}
        given += tracker.push(stream.name, stream.time_s[row], values)
    given += tracker.flush()
    assert (tracker.arrivals["late"], tracker.arrivals["too_late"]) == (0, 0)
    rows = {info.time_s: belief.mean for belief, info in given}
    for time_s in track.time_s:
        assert time_s in rows
    np.testing.assert_array_equal(given[-1][0].mean, track.last_belief.mean)


def test_a_closure_that_is_never_used_says_why(sculler, rowed):
    def silent(recording, structure=None, **settings):
        config = oarlock.Config(structure=structure, **settings)
        notes = oarlock.track(sculler, recording, config=config).notes
        return [note for note in notes if "never used" in note and "closure" in note]

    oars = [joint.name for joint in sculler.describe().inputs]
    # strapdown links hold an input between its readings, and move an oar without encoder with its hand
    kept = silent(rowed, "tree", inputs=oars, sample_rate_hz=0.0, merge_s=1e-9)
    assert kept and all("leave out the setting inputs" in note for note in kept)
    without = silent(rowed.without("l_oar_alpha"), "tree", inputs=oars)
    assert any("no stream for l_oar_alpha" in note for note in without)
    assert all("switched off" in note for note in silent(rowed, closures=False))
    assert not silent(rowed)


def test_shuffled_delivery_gives_the_bits_of_the_recording(sculler, rowed):
    whole = oarlock.track(sculler, rowed, config=oarlock.Config(output_rate_hz=0))
    tracker = oarlock.Tracker(sculler, config=oarlock.Config(**whole.provenance["config"]))
    rng, readings = np.random.default_rng(1), []
    for stream in rowed.streams:
        arrivals = stream.time_s + rng.uniform(0, 0.025, len(stream.time_s))
        for row, at_s in enumerate(arrivals):
            values = {name: value[row] for name, value in stream.values.items()}
            readings.append((at_s, stream.name, stream.time_s[row], values.get("value", values)))
    given = []
    for _, name, stamp_s, values in sorted(readings, key=lambda reading: reading[0]):
        given += tracker.push(name, stamp_s, values)
    given += tracker.flush()
    assert tracker.arrivals == {
        "received": len(readings), "late": 0, "too_late": 0, "repeated": 0, "waiting": 0
    }  # fmt: skip
    np.testing.assert_array_equal([info.time_s for _, info in given], whole.time_s)
    np.testing.assert_array_equal(given[-1][0].mean, whole.last_belief.mean)


def test_streams_without_a_sensor_are_left_out_with_one_note(sculler, rowed):
    others = [
        oarlock.recording.ScalarStream(name, [0.0, 1.0, 2.0], [1.0, 2.0, 3.0])
        for name in ("pulse", "grip_kg")
    ]
    track = oarlock.track(sculler, oarlock.Recording([*rowed.streams, *others]))
    notes = [note for note in track.notes if "without a sensor" in note]
    assert notes == ["2 streams without a sensor in this model: pulse, grip_kg; not used"]
    np.testing.assert_array_equal(track.q, oarlock.track(sculler, rowed).q)
    typo = oarlock.Recording([*rowed.without("seat").streams, part_named(rowed.sensor("seat"), "saet")])
    assert_refused(lambda: oarlock.track(sculler, typo), 'Did you mean "seat"', "--without saet")
    assert_refused(lambda: oarlock.track(sculler, oarlock.Recording(others)), "No stream of the recording")


def part_named(stream, name):
    return oarlock.recording.ScalarStream(name, stream.time_s, stream.value, stream.unit)


@pytest.mark.parametrize(("after_s", "bound_deg"), [(0.004, 0.1), (0.15, 1.5), (0.5, 1.5)])
def test_encoders_whose_first_reading_is_later_than_that_of_units_do_not_tilt_the_start(
    sculler, rowed, after_s, bound_deg
):
    """Their coordinates were at rest until then: a trunk began 8 deg off, and was still 2 deg off after 20 s.

    Where the first posture is fitted without them, it is known to the 2.3 deg of its band.
    """
    units = [stream for stream in rowed if isinstance(stream, oarlock.recording.ImuStream)]
    encoders = oarlock.Recording([stream for stream in rowed if stream not in units]).slice(start_s=after_s)
    late, whole = (oarlock.track(sculler, one) for one in (oarlock.Recording([*units, *encoders]), rowed))
    time_s = np.linspace(0.6, 3.8, 9)
    whole_rad, late_rad = (
        np.interp(time_s, track.time_s, track["trunk"].angle_rad) for track in (whole, late)
    )
    print(f"{after_s} s: apart by {np.degrees(np.abs(late_rad - whole_rad)).max():.2f} deg")
    assert np.degrees(np.abs(late_rad - whole_rad)).max() < bound_deg


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_sensors_apart_are_as_accurate_as_together(sculler, seed):
    motion = rowing.sculling(sculler, 20.0, 24, surge=False, seed=seed)
    truth, _ = oarlock.simulate(sculler, motion, ["seat"], rate_hz=100.0)
    scores = {}
    for name, rates_hz, jitter_s in (("together", COMMON_HZ, 0.0), ("apart", RATES_HZ, JITTER_S)):
        track = oarlock.track(sculler, recorded(sculler, motion, rates_hz, seed, jitter_s))
        evaluation = oarlock.evaluate(track, truth)
        joints = [j.name for j in evaluation.joints if not j.name.endswith("theta") and j.name != "seat"]
        scores[name] = evaluation.mean_rmse_deg(joints), evaluation.mean_coverage(joints)
    assert scores["apart"][0] < 1.2 * scores["together"][0], scores
    assert abs(scores["apart"][1] - scores["together"][1]) < 0.03, scores


@pytest.mark.parametrize("phase", [0.3, 0.5])
def test_exact_orientations_halfway_between_two_samples(tmp_path, phase):
    """The velocity that brings a reading to its sample must not feed back on itself: it grew to 1e7 deg."""
    shipped = (resources.files("oarlock.model") / "shipped" / "pendulum3.toml").read_text()
    keys = 'kind = "orientation"\nstd_rad = 0.01\nframe'
    sensors = "".join(
        f'[[sensor]]\nname = "{n}"\n{keys} = "{n}_link"\n' for n in ("upper", "middle", "lower")
    )
    (tmp_path / "turned.toml").write_text(shipped.partition("\n[[sensor]]\n")[0] + "\n" + sensors)
    model = oarlock.load_model(tmp_path / "turned.toml")
    rate_hz, knots = 50.0, np.arange(0.0, 5.0, 0.02)
    q = 0.35 * np.sin(2 * np.pi * np.outer(knots, [0.4, 0.6, 0.7]))
    truth, together = oarlock.simulate(
        model, oarlock.simulation.Motion(tuple(model.coordinate_names), knots, q), seed=2, rate_hz=rate_hz
    )
    late_s = phase / rate_hz - together.start_s
    apart = oarlock.Recording([s.at_rows(slice(None), s.time_s + late_s) for s in together.streams])

    def error_deg(track, late_s):
        expected = np.column_stack([np.interp(track.time_s - late_s, truth.time_s, c) for c in truth.q.T])
        return np.degrees(np.sqrt(np.mean((track.q - expected)[100:-2] ** 2)))

    gathered = oarlock.track(model, apart, config=oarlock.Config(sample_rate_hz=rate_hz))
    assert error_deg(gathered, late_s) < 1.1 * error_deg(oarlock.track(model, together), 0.0)
