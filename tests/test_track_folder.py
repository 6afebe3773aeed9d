"""A track comes back from its folder as it was saved, to the last bit."""

import numpy as np
import pytest

import oarlock
from exact_recording import load_excerpt, sculler

ARRAYS = ("time_s", "q", "qd", "qdd", "q_std", "qd_std", "qdd_std", "observed")
INFOS = ("nis", "used", "rejected", "missing", "inertial_nis", "inertial_used", "field")


@pytest.fixture(scope="module")
def recording() -> oarlock.Recording:
    return load_excerpt().recording.slice(end_s=3.0)


@pytest.fixture(scope="module")
def track(recording) -> oarlock.Track:
    return oarlock.track(sculler(), recording)


def assert_same(one: oarlock.Track, other: oarlock.Track) -> None:
    for name in ARRAYS:
        ours, theirs = getattr(one, name), getattr(other, name)
        assert ours.dtype == theirs.dtype, name
        assert np.array_equal(ours, theirs, equal_nan=name != "observed"), name
    assert (one.joint_names, one.joint_units, one.smoothed) == (
        other.joint_names,
        other.joint_units,
        other.smoothed,
    )
    assert tuple(one.notes) == tuple(other.notes)
    assert list(one.slow) == list(other.slow)
    for name, slow in one.slow.items():
        assert slow.unit == other.slow[name].unit
        assert np.array_equal(slow.value, other.slow[name].value, equal_nan=True), name
        assert np.array_equal(slow.std, other.slow[name].std, equal_nan=True), name


def test_filtered_and_smoothed_tracks_come_back(track, tmp_path):
    for whole, folder in ((track, tmp_path / "filtered"), (oarlock.smooth(track), tmp_path / "smoothed")):
        whole.save(folder)
        loaded = oarlock.load_track(folder)
        assert_same(whole, loaded)
        assert loaded.info.sensor_names == whole.info.sensor_names
        for name in INFOS:
            ours, theirs = getattr(whole.info, name), getattr(loaded.info, name)
            assert ours.dtype == theirs.dtype, name
            assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f"), name
        assert loaded.beliefs.state_names == whole.beliefs.state_names
        for name in ("time_s", "mean", "covariance"):
            assert np.array_equal(getattr(whole.beliefs, name), getattr(loaded.beliefs, name)), name


def test_truth_comes_back(tmp_path):
    truth = load_excerpt().truth
    truth.save(tmp_path)
    loaded = oarlock.load_track(tmp_path)
    assert_same(truth, loaded)
    assert (loaded.info, loaded.beliefs) == (None, None)


def test_scores_of_a_loaded_track_are_the_same(track, tmp_path):
    track.save(tmp_path)
    truth = load_excerpt().truth
    kept, loaded = (oarlock.evaluate(t, truth).to_dict() for t in (track, oarlock.load_track(tmp_path)))
    assert kept == loaded


def test_positions_of_a_loaded_track_are_the_same(recording, tmp_path):
    longer = oarlock.load_model("sculler", parameters={"l_fa_r": 0.28})
    track = oarlock.track(longer, recording)
    track.save(tmp_path)
    loaded = oarlock.load_track(tmp_path)
    assert np.array_equal(loaded.frame_positions("r_hand"), track.frame_positions("r_hand"))


def test_positions_follow_the_calibration(recording):
    calibration = oarlock.Calibration(parameters={"l_fa_r": 0.30})
    track = oarlock.track(sculler(), recording, calibration=calibration)
    forearm = track.frame_positions("r_wrist") - track.frame_positions("r_elbow")
    np.testing.assert_allclose(np.linalg.norm(forearm, axis=1), 0.30, atol=1e-12)


def test_provenance_says_how_it_came_about(recording, tmp_path):
    track = oarlock.track(sculler(), recording, config=oarlock.Config(alpha=0.5, output_rate_hz=25.0))
    track.save(tmp_path)
    loaded = oarlock.load_track(tmp_path).provenance
    for found in (track.provenance, loaded):
        assert found["oarlock"] == oarlock.__version__
        assert found["model"] == "sculler"
        assert len(found["model_sha256"]) == len(found["recording_sha256"]) == 64
        assert found["config"]["alpha"] == 0.5
        assert found["steps_per_s"] > 0
        assert "r_forearm" in found["nominal_mounts"]
    assert len(track.time_s) == pytest.approx(3.0 * 25.0, abs=2)


def test_config_of_a_loaded_track_is_the_one_it_was_tracked_with(recording, tmp_path):
    config = oarlock.Config(gate=False)
    track = oarlock.track(sculler(), recording, config=config)
    track.save(tmp_path)
    loaded = oarlock.Config(**oarlock.load_track(tmp_path).provenance["config"])
    # What is left to be found from the time stamps is found.
    found = {"sample_rate_hz": 0.0, "output_rate_hz": 0.0, "inputs": loaded.inputs, "stamp_std_s": {}}
    assert (
        loaded == oarlock.Config(**(config.to_dict() | found)) == oarlock.Config(**track.provenance["config"])
    )


def test_another_recording_has_another_hash(recording, track):
    back = recording["back"]
    gyro = back.gyro_rad_s.copy()
    gyro[100, 0] = np.nextafter(gyro[100, 0], 1.0)
    touched = [s for s in recording.streams if s.name != "back"]
    touched.insert(0, oarlock.recording.ImuStream("back", back.time_s, gyro, back.accel_m_s2, back.mag_ut))
    other = oarlock.track(sculler(), oarlock.Recording(touched))
    assert other.provenance["recording_sha256"] != track.provenance["recording_sha256"]
    assert other.provenance["model_sha256"] == track.provenance["model_sha256"]


def test_a_loaded_track_cannot_be_smoothed(track, tmp_path):
    track.save(tmp_path)
    with pytest.raises(oarlock.DataError, match="no samples"):
        oarlock.smooth(oarlock.load_track(tmp_path))


def test_without_its_model_a_track_has_no_positions(track, tmp_path):
    track.save(tmp_path)
    (tmp_path / "model.toml").unlink()
    loaded = oarlock.load_track(tmp_path)
    assert_same(track, loaded)
    with pytest.raises(oarlock.DataError, match="without its model"):
        loaded.frame_positions("r_wrist")


@pytest.mark.parametrize(
    "file", ["track.parquet", "sensors.parquet", "beliefs.parquet", "run.toml", "model.toml"]
)
def test_a_damaged_file_is_named(track, file, tmp_path):
    track.save(tmp_path)
    (tmp_path / file).write_text("no such thing", encoding="utf-8")
    with pytest.raises((oarlock.DataError, oarlock.ModelError), match=file):
        oarlock.load_track(tmp_path)


@pytest.mark.parametrize("file", ["track.parquet", "sensors.parquet", "beliefs.parquet", "run.toml"])
def test_a_missing_file_is_named(track, file, tmp_path):
    track.save(tmp_path)
    (tmp_path / file).unlink()
    with pytest.raises(oarlock.DataError, match=file):
        oarlock.load_track(tmp_path)


@pytest.mark.parametrize("key", ["joints", "provenance", "states"])
def test_a_key_that_is_gone_is_named(track, key, tmp_path):
    track.save(tmp_path)
    run = tmp_path / "run.toml"
    run.write_text(run.read_text(encoding="utf-8").replace(key, f"old_{key}"), encoding="utf-8")
    with pytest.raises(oarlock.DataError, match=key):
        oarlock.load_track(tmp_path)


def test_an_empty_folder_holds_no_track(tmp_path):
    with pytest.raises(oarlock.DataError, match="contains no track"):
        oarlock.load_track(tmp_path)
