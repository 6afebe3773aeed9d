"""Recordings tracked side by side: the same bits as alone, in order, each with its own error."""

import json
import pickle
import signal
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.rowing.simulation.experiment import simulate_sculling

# Of other lengths, so that they end in another order than they began.
DURATIONS_S = (3.0, 1.0, 2.0, 1.5)
WALL = {"wall_s", "steps_per_s", "smoothing_wall_s"}


@cache
def model() -> oarlock.Model:
    return oarlock.load_model("sculler")


@cache
def recordings() -> tuple[oarlock.Recording, ...]:
    made = (simulate_sculling(model(), "B-B", s, seed=k)[1] for k, s in enumerate(DURATIONS_S))
    return tuple(made)


@cache
def alone() -> tuple[oarlock.Track, ...]:
    return tuple(oarlock.track(model(), recording) for recording in recordings())


def content(track: oarlock.Track) -> dict[str, Any]:
    """All of a track but its model and how long it took, as bytes and texts."""
    state = track.__getstate__() | {"model": None}
    state["provenance"] = {k: v for k, v in track.provenance.items() if k not in WALL}
    return {name: pickle.dumps(value) for name, value in state.items()}


def assert_same(found: oarlock.Track, expected: oarlock.Track) -> None:
    ours, theirs = content(found), content(expected)
    assert [name for name in theirs if ours[name] != theirs[name]] == []
    assert set(found.provenance) == set(expected.provenance)


@pytest.mark.parametrize("threads", [1, 2, 4, None])
def test_any_number_of_threads_gives_what_track_gives_alone(threads: int | None) -> None:
    tracks = oarlock.track_many(model(), recordings(), threads=threads)
    for found, expected in zip(tracks, alone(), strict=True):
        assert_same(found, expected)


def test_smoothed_is_what_smooth_gives_alone() -> None:
    tracks = oarlock.track_many(model(), recordings()[:2], smooth=True)
    for found, expected in zip(tracks, alone(), strict=False):
        assert_same(found, oarlock.smooth(expected))


def test_a_track_that_gave_its_room_is_filtered_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("oarlock.tracking.tracking.ROOM_TO_GIVE_BYTES", 0)
    given, asked = (oarlock.track(model(), recordings()[1]) for _ in range(2))
    expected = alone()[1]
    assert np.array_equal(asked.q, expected.q, equal_nan=True)
    smoothed = [oarlock.smooth(track) for track in (given, asked)]
    monkeypatch.undo()
    for found in smoothed:
        assert_same(found, oarlock.smooth(expected))
    # once from what it kept, once filtered again
    assert_same(asked, expected)
    assert_same(given, expected)
    assert_same(oarlock.smooth(given), oarlock.smooth(expected))


def test_calibration_and_config_may_be_one_for_each() -> None:
    calibrations = [None, oarlock.Calibration(parameters={"l_ua_r": 0.29})]
    configs = [oarlock.Config(filter="ekf"), None]
    tracks = oarlock.track_many(model(), recordings()[:2], calibrations, configs)
    for k, found in enumerate(tracks):
        assert_same(found, oarlock.track(model(), recordings()[k], calibrations[k], configs[k]))
    assert tracks[1].model is not None and tracks[1].model.parameters["l_ua_r"] == 0.29


def test_nothing_to_track_is_nothing() -> None:
    assert oarlock.track_many(model(), []) == []


# --- errors -------------------------------------------------------------------------------------------


def of_another_model() -> oarlock.Recording:
    time_s = np.arange(100) / 100
    stream = oarlock.recording.ImuStream("upper", time_s, gyro_rad_s=np.zeros((100, 3)))
    return oarlock.Recording([stream], {"source": {"format": "csv", "file": "swing.csv"}})


def test_an_error_names_the_recording_and_its_source() -> None:
    given = [recordings()[1], of_another_model()]
    with pytest.raises(oarlock.DataError, match=r'recordings\[1\] \(swing\.csv\): .*"upper".*"sculler"'):
        oarlock.track_many(model(), given)


def test_an_error_may_be_returned_in_its_place() -> None:
    wrong = oarlock.Config(initial_q=[0.0])
    given = [recordings()[1], of_another_model(), recordings()[3], recordings()[1]]
    found = oarlock.track_many(model(), given, config=[None, None, wrong, None], on_error="return")
    assert isinstance(found[0], oarlock.Track) and isinstance(found[3], oarlock.Track)
    assert_same(found[0], alone()[1])
    assert isinstance(found[1], oarlock.DataError) and str(found[1]).startswith("recordings[1] (swing.csv): ")
    assert isinstance(found[2], oarlock.DataError) and str(found[2]).startswith("recordings[2]: ")


def test_of_several_errors_the_first_in_order_is_raised() -> None:
    wrong = oarlock.Config(initial_q=[0.0])
    for threads in (1, 2):
        with pytest.raises(oarlock.DataError, match=r"recordings\[1\]: "):
            oarlock.track_many(model(), recordings(), config=[None, wrong, wrong, None], threads=threads)


def test_an_error_of_divergence_keeps_its_time_and_notes() -> None:
    from oarlock.tracking.many import _named

    lost = oarlock.DivergedError("lost at 3.000 s")
    lost.time_s = 3.0
    lost.add_note("back: odd")
    named = _named(lost, "recordings[2]")
    assert isinstance(named, oarlock.DivergedError)
    assert (str(named), named.time_s) == ("recordings[2]: lost at 3.000 s", 3.0)
    assert named.__notes__ == ["back: odd"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"recordings": "one"}, r"expected a list of recordings, got Recording; use oarlock\.track"),
        ({"model": ["sculler"]}, "one Model for all recordings, got list"),
        ({"threads": 0}, "threads = 0: expected 1 or more"),
        ({"threads": 1.5}, r"threads = 1\.5"),
        ({"on_error": "ignore"}, 'on_error = \'ignore\': expected "raise" or "return"'),
        ({"calibration": [None]}, "1 in calibration for 4 recordings"),
        ({"config": [None, {"gate": True}, None, None]}, r"config\[1\] is a dict; expected Config"),
        ({"calibration": 3}, r"calibration\[0\] is a int; expected Calibration"),
    ],
)
def test_what_does_not_fit_together_is_refused(arguments: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {"model": model(), "recordings": recordings()} | arguments
    if given["recordings"] == "one":
        given["recordings"] = recordings()[0]
    with pytest.raises(oarlock.DataError, match=words):
        oarlock.track_many(**given)


# --- progress and stopping ----------------------------------------------------------------------------


def test_progress_grows_to_one() -> None:
    shares: list[float] = []
    oarlock.track_many(model(), recordings(), smooth=True, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_ctrl_c_stops_the_work() -> None:
    calls: list[float] = []

    def interrupt(share: float) -> None:
        calls.append(share)
        signal.raise_signal(signal.SIGINT)

    # As at a terminal; the workers of a parallel test run ignore it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            oarlock.track_many(model(), recordings(), progress=interrupt)
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(calls) == 1


# --- command line -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("many")
    for k in (1, 2, 3):
        recordings()[k].save(folder / f"trial_{k}")
    return folder


def test_several_recordings_write_a_folder_each(trials: Path, tmp_path: Path) -> None:
    given = [trials / "trial_1", trials / "trial_2" / "recording.toml", trials / "trial_3"]
    done = run("track", *given, "--model", "sculler", "--jobs", 2, "--out", tmp_path / "out", "--csv")
    for k in (1, 2, 3):
        found = oarlock.load_track(tmp_path / "out" / f"trial_{k}")
        assert found.q.tobytes() == alone()[k].q.tobytes()
        assert (tmp_path / "out" / f"trial_{k}" / "track.csv").is_file()
        assert (tmp_path / "out" / f"trial_{k}" / "report.html").is_file()
    rows = [line.split()[0] for line in done.stdout.splitlines() if line.startswith("  trial_")]
    assert rows == ["trial_1", "trial_2", "trial_3"]


def test_one_that_fails_is_named_and_the_others_are_written(trials: Path, tmp_path: Path) -> None:
    given = [trials / "trial_1", trials / "nowhere", trials / "trial_3"]
    done = run("track", *given, "--model", "sculler", "--out", tmp_path, "--json", status=1)
    found = json.loads(done.stdout)["recordings"]
    assert list(found) == ["trial_1", "nowhere", "trial_3"]
    assert "nowhere" in found["nowhere"]["error"]
    assert found["trial_3"]["samples"] > 100
    assert "1 of 3 recordings failed" in done.stderr and "nowhere" in done.stderr
    assert (tmp_path / "trial_3" / "run.toml").is_file()
    assert not (tmp_path / "nowhere").exists()


def test_two_recordings_of_one_name_are_refused(trials: Path, tmp_path: Path) -> None:
    recordings()[1].save(tmp_path / "trial_1")
    given = [trials / "trial_1", tmp_path / "trial_1"]
    refused = run("track", *given, "--model", "sculler", "--out", tmp_path / "out", status=2)
    assert "trial_1" in refused.stderr and "would both write" in refused.stderr
    assert not (tmp_path / "out").exists()


def test_results_do_not_go_into_recordings(trials: Path) -> None:
    given = [trials / "trial_1", trials / "trial_2"]
    refused = run("track", *given, "--model", "sculler", "--out", trials, "--force", status=2)
    assert "is a recording" in refused.stderr
