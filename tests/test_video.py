"""A video finds its place in a track's time, by motion or by a clap; a camera sees what that of OpenCV sees."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.movement.video import (
    Camera,
    align,
    body_motion,
    clap_offset,
    load_camera,
    motion_of_places,
    picture_motion,
    video_info,
    with_drift,
)
from oarlock.movement.video.clap import SOUND_M_S
from oarlock.movement.video.picture_motion import cell_flow, courses_of, whole_shift
from oarlock.movement.video.shown import shown_video
from oarlock.recording.streams import ImuStream
from refusals import assert_refused
from video_drawing import Motion, side_camera, write_video

pytest.importorskip("av", reason="NO VIDEO WAS READ: pip install av")

FPS = 25.0
FRAME_S = 1.0 / FPS
OFFSET_S = 7.3
REST_S = 4.0
# Points, camera and pixels by projectPoints of OpenCV 5.0.0.
POINTS_M = np.array([[0.1, 0.2, 0.3], [-0.6, 0.9, 0.4], [0.8, -0.5, 1.1], [-0.3, 1.4, -0.7]])
CAMERA_FILE = """width_px = 1920
height_px = 1080
fx = 1410.0
fy = 1395.0
cx = 955.0
cy = 548.0
distortion = [-0.28, 0.11, 0.0013, -0.0021, -0.017]
rotation_vector = [0.12, 1.35, -0.08]
translation_m = [0.25, 0.4, 4.5]
"""
OPENCV_PX = [
    [1138.291526705814, 720.8959613455224],
    [1119.663238073946, 871.875485970626],
    [1446.1932116423022, 469.0622863398779],
    [863.9180609476683, 1082.2229092424823],
]


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(30.0, (20.0, 32.0), seed=1)


@pytest.fixture(scope="module")
def drawn(motion: Motion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a track of rising rate and a video of 9 s of it."""
    folder = tmp_path_factory.mktemp("video")
    motion.track.save(folder / "track")
    stamps_s = np.arange(0.0, 9.0, FRAME_S)
    small = replace(side_camera(160, 90), focal_px=(240.0, 240.0))
    write_video(folder / "piece.webm", motion, OFFSET_S + stamps_s, stamps_s, camera=small)
    return folder


def seen(motion: Motion, own_s: np.ndarray, stamps_s: np.ndarray):
    """Courses of a picture without pixels: each frame of the body is a cell that flows as a camera sees it."""
    pixels = side_camera().pixels(motion.at(own_s))
    rng = np.random.default_rng(0)
    flow = np.diff(pixels, axis=0) / np.diff(stamps_s)[:, None, None]
    still = np.zeros((len(flow), 3 * flow.shape[1], 2))
    flow = np.concatenate([flow, still], axis=1)
    noise = 3.0 * rng.standard_normal(flow.shape)
    return courses_of(0.5 * (stamps_s[1:] + stamps_s[:-1]), flow + noise, "video")


def test_the_verb_finds_a_drawn_video_within_a_frame(drawn):
    said = json.loads(run("calibrate", "video", drawn / "track", drawn / "piece.webm", "--json").stdout)
    assert abs(said["offset_s"] - OFFSET_S) < FRAME_S
    assert said["candidates"] == []
    shown = run("calibrate", "video", drawn / "track", drawn / "piece.webm", "--near-s", "7").output
    assert "oarlock view" in shown and "--offset-s 7." in shown


def test_the_page_refers_to_the_video_and_holds_no_picture(drawn, tmp_path):
    page = tmp_path / "view.html"
    asked = (
        "view",
        drawn / "track",
        "--video",
        drawn / "piece.webm",
        "--drift-ppm",
        "20",
        "--no-open",
        "--json",
    )
    said = json.loads(run(*asked, "--offset-s", "7.3", "--out", page).stdout)
    assert said["video"]["offset_s"] == 7.3 and said["video"]["drift_ppm"] == 20.0
    text = page.read_text(encoding="utf-8")
    assert "piece.webm" in text and "media-src 'self' file: blob:" in text and "data:video" not in text


def test_what_does_not_fit_together_is_refused(drawn, tmp_path):
    view = ("view", drawn / "track", "--no-open", "--out", tmp_path / "a.html")
    assert "--camera needs --video" in run(*view, "--camera", "c.toml", status=2).output
    assert "no such file" in run(*view, "--video", tmp_path / "none.mp4", status=1).output
    (tmp_path / "text.mp4").write_text("no video")
    assert "cannot be read as a video" in run(*view, "--video", tmp_path / "text.mp4", status=1).output
    (tmp_path / "camera.toml").write_text(CAMERA_FILE.replace("1080", "1440"))
    asked = ("--video", drawn / "piece.webm", "--offset-s", "1", "--camera", tmp_path / "camera.toml")
    assert "1920 x 1440 px, the video shows 160 x 90" in run(*view, *asked, status=1).output.replace(
        "\n", " "
    )


def test_a_start_decides(motion):
    stamps_s = np.arange(0.0, 16.0, FRAME_S)
    track_s = np.arange(0.0, 26.0, 0.01)
    started = lambda t: np.maximum(t - REST_S, 0.0)  # noqa: E731
    body = motion_of_places(track_s, motion.at(started(track_s)))
    found = align(seen(motion, started(stamps_s + 1.37), stamps_s), body, frame_s=FRAME_S)
    assert not found.ambiguous
    assert abs(found.offset_s - 1.37) < 0.5 * FRAME_S


def test_equal_cycles_are_said_to_be_ambiguous(motion):
    stamps_s, track_s, period_s = np.arange(0.0, 12.0, FRAME_S), np.arange(0.0, 40.0, 0.01), 2.5
    again = lambda t: 5.0 + 0.5 * period_s * (1.0 - np.cos(2.0 * np.pi * t / period_s))  # noqa: E731
    body = motion_of_places(track_s, motion.at(again(track_s)))
    found = align(seen(motion, again(stamps_s + 11.2), stamps_s), body)
    assert found.ambiguous
    offsets = [found.offset_s, *(one.offset_s for one in found.candidates)]
    off = [(one - 11.2 + 0.5 * period_s) % period_s - 0.5 * period_s for one in offsets]
    assert min(np.abs(off)) < FRAME_S
    assert_refused(found.require_one, "fit equally well", "--offset-s")
    near = align(seen(motion, again(stamps_s + 11.2), stamps_s), body, near_s=11.0, within_s=1.0)
    assert not near.ambiguous and abs(near.offset_s - 11.2) < FRAME_S


def test_what_moves_otherwise_is_refused(motion):
    rng = np.random.default_rng(4)
    stamps_s = np.arange(0.0, 20.0, FRAME_S)
    other = courses_of(stamps_s, rng.standard_normal((len(stamps_s), 12, 2)), "video")
    assert_refused(lambda: align(other, body_motion(motion.track)), "does not move like the track")
    assert_refused(lambda: align(other, body_motion(motion.track), near_s=900.0), "in common")


@pytest.mark.long
def test_clocks_that_drift_are_fitted():
    motion = Motion(60.0, (20.0, 32.0), seed=5)
    track_s = np.arange(0.0, 240.0, 0.02)
    # to and fro through a minute of rising rates
    own = lambda t: np.abs(np.mod(t, 118.0) - 59.0)  # noqa: E731
    body = motion_of_places(track_s, motion.at(own(track_s)))
    stamps_s = np.arange(0.0, 225.0, FRAME_S)
    picture = seen(motion, own(3.0 + (1.0 + 300e-6) * stamps_s), stamps_s)
    found = with_drift(picture, body, align(picture, body, near_s=3.0, frame_s=FRAME_S), FRAME_S)
    assert 0.0 < found.drift_std_ppm < 60.0
    assert abs(found.drift_ppm - 300.0) < 3.0 * found.drift_std_ppm
    ends = [found.offset_s + found.drift_ppm * 1e-6 * t - 3.0 - 300e-6 * t for t in (0.0, 225.0)]
    assert np.abs(ends).max() < 0.5 * FRAME_S


def test_flow_and_shift_are_those_of_the_picture():
    y, x = np.mgrid[0:72, 0:128].astype(np.float32)
    pattern = lambda dx, dy: (120 + 50 * np.sin((x - dx) / 5) * np.cos((y - dy) / 6)).astype(np.float32)  # noqa: E731
    flow = cell_flow(pattern(0.0, 0.0), pattern(0.5, -0.3))
    np.testing.assert_allclose(
        np.median(flow, axis=0), [0.5, -0.3], atol=0.05
    )  # the linearised flow's own error
    noise = np.random.default_rng(0).standard_normal((72, 128)).astype(np.float32)
    assert whole_shift(noise, np.roll(noise, (5, -9), axis=(0, 1))) == (-9, 5)


def clapped(
    times_s: tuple[float, ...], rate_hz: float, lasting_s: float = 12.0
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    time_s = np.arange(0.0, lasting_s, 1.0 / rate_hz)
    sound = 0.01 * rng.standard_normal(len(time_s))
    for one in times_s:
        after = time_s - one
        sound += (
            np.where(after >= 0, np.exp(-np.clip(after, 0, 1) / 0.01), 0.0)
            * rng.standard_normal(len(time_s))
            * 0.5
        )
    return time_s, sound


def struck(times_s: tuple[float, ...], lasting_s: float = 30.0) -> ImuStream:
    time_s = np.arange(0.0, lasting_s, 0.01)
    accel = np.tile([0.0, 0.0, 9.81], (len(time_s), 1)) + 0.1 * np.random.default_rng(3).standard_normal(
        (len(time_s), 3)
    )
    for one in times_s:
        accel[np.searchsorted(time_s, one), 0] += 60.0
    return ImuStream("wrist", time_s, accel_m_s2=accel)


@pytest.mark.parametrize("heard_s", [(3.0,), (3.0, 4.1, 6.3)])
def test_claps_align(heard_s):
    felt = struck(tuple(one + 8.25 for one in heard_s))
    found = clap_offset(clapped(heard_s, 16_000.0), felt)
    # a window of sound and a step of the unit
    assert abs(found.offset_s - 8.25) < 0.004 + 0.01
    assert found.claps == len(heard_s)
    late = clap_offset(clapped(heard_s, 16_000.0), felt, distance_m=34.3)
    assert late.offset_s - found.offset_s == pytest.approx(34.3 / SOUND_M_S, abs=1e-9)


def test_claps_that_do_not_decide_are_refused():
    sound = clapped((3.0, 5.0), 16_000.0)
    assert_refused(lambda: clap_offset(sound, struck((9.0,))), "fit equally well", "--offset-s")
    assert_refused(lambda: clap_offset(sound, struck(())), "felt no jolt")
    assert_refused(lambda: clap_offset(clapped((), 16_000.0), struck((9.0,))), "no sudden sound")


def test_the_verb_aligns_by_a_clap(motion, tmp_path):
    _, sound = clapped((1.5,), 48_000.0, 3.0)
    stamps_s = np.arange(0.0, 3.0, 0.2)
    tiny = side_camera(64, 36)
    write_video(tmp_path / "clap.webm", motion, stamps_s, stamps_s, camera=tiny, sound=np.clip(sound, -1, 1))
    oarlock.Recording([struck((6.0,))]).save(tmp_path / "rec")
    said = json.loads(run("calibrate", "clap", tmp_path / "rec", tmp_path / "clap.webm", "--json").stdout)
    # Opus moves a clap by some milliseconds
    assert abs(said["offset_s"] - 4.5) < 0.02
    assert video_info(tmp_path / "clap.webm").sound


def test_a_camera_sees_what_that_of_opencv_sees(tmp_path):
    (tmp_path / "camera.toml").write_text(CAMERA_FILE)
    camera = load_camera(tmp_path / "camera.toml")
    np.testing.assert_allclose(camera.pixels(POINTS_M), OPENCV_PX, rtol=0, atol=1e-8)
    behind = camera.camera_from_root.T @ (np.array([0.0, 0.0, -1.0]) - camera.root_in_camera_m)
    assert np.isnan(camera.pixels(behind)).all()
    turned = {
        **camera.described(),
        "rotation": camera.camera_from_root.tolist(),
        "translation_m": [0.25, 0.4, 4.5],
    }
    turned |= {"fx": 1410, "fy": 1395, "cx": 955, "cy": 548}
    (tmp_path / "camera.json").write_text(json.dumps(turned))
    np.testing.assert_allclose(
        load_camera(tmp_path / "camera.json").pixels(POINTS_M), OPENCV_PX, rtol=0, atol=1e-8
    )


@pytest.mark.parametrize(
    ("was", "becomes", "words"),
    [
        ("fx = 1410.0", "fx = -1.0", "must be above 0"),
        ("fx = 1410.0", "", "fx is None; give a number"),
        ("[0.25, 0.4, 4.5]", "[0.25, 0.4]", "a list of 3 numbers"),
        ("rotation_vector = [0.12, 1.35, -0.08]", "", "either rotation"),
        (
            "rotation_vector = [0.12, 1.35, -0.08]",
            "rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 2]]",
            "is not one",
        ),
        ("cx =", "cx", "looks like this"),
    ],
)
def test_a_wrong_camera_file_is_refused(tmp_path, was, becomes, words):
    (tmp_path / "camera.toml").write_text(CAMERA_FILE.replace(was, becomes))
    assert_refused(lambda: load_camera(tmp_path / "camera.toml"), words)


def test_an_offset_that_is_no_number_is_refused(drawn):
    info = video_info(drawn / "piece.webm")
    assert info.width_px == 160 and info.frame_s == pytest.approx(FRAME_S, abs=1e-3)
    assert_refused(
        lambda: shown_video(drawn / "piece.webm", drawn, info, offset_s=float("nan")),
        "finite offset",
    )


STARTS = {"25": 25.0, "29.97": 30000.0 / 1001.0, "60": 60.0}


def started_video(file: Path, motion: Motion, stamps_s: np.ndarray, **kinds) -> tuple[float, float]:
    """Error of the offset, s, and time of a frame, s, of a video with a start from rest."""
    own = lambda t: np.maximum(t - REST_S, 0.0)  # noqa: E731
    track_s = np.arange(0.0, 26.0, 0.01)
    write_video(file, motion, own(stamps_s + 1.37), stamps_s, **kinds)
    found = align(picture_motion(file), motion_of_places(track_s, motion.at(own(track_s))))
    found.require_one()
    return found.offset_s - 1.37, float(np.median(np.diff(stamps_s)))


@pytest.mark.long
@pytest.mark.parametrize("fps", STARTS.values(), ids=STARTS)
def test_every_frame_rate_within_a_frame(tmp_path, motion, fps):
    error_s, frame_s = started_video(tmp_path / "a.webm", motion, np.arange(0.0, 15.0, 1.0 / fps))
    assert abs(error_s) < frame_s


@pytest.mark.long
@pytest.mark.parametrize(
    "kinds",
    [{"shake_px": 4.0}, {"bit_rate": 40_000, "noise": 8.0}],
    ids=["carried camera", "noise and compression"],
)
def test_poor_pictures_within_a_frame(tmp_path, motion, kinds):
    error_s, frame_s = started_video(tmp_path / "a.webm", motion, np.arange(0.0, 15.0, FRAME_S), **kinds)
    assert abs(error_s) < frame_s


@pytest.mark.long
def test_a_variable_frame_rate_within_a_frame(tmp_path, motion):
    rng = np.random.default_rng(3)
    stamps_s = np.arange(0.0, 15.0, 1.0 / 30.0)
    stamps_s = stamps_s + np.round(rng.uniform(0.0, 0.4, len(stamps_s)) / 30.0, 3)
    stamps_s = stamps_s[rng.uniform(size=len(stamps_s)) > 0.15]
    assert max(b - a for a, b in pairwise(stamps_s)) > 0.05
    error_s, frame_s = started_video(tmp_path / "a.webm", motion, stamps_s)
    assert abs(error_s) < frame_s


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_steady_strokes_are_found_or_said_to_be_ambiguous(seed):
    """Strokes that differ a little may decide; a wrong offset without a word may not come."""
    motion = Motion(40.0, 24.0, seed=10 + seed)
    stamps_s = np.arange(0.0, 15.0, FRAME_S)
    found = align(seen(motion, 11.2 + stamps_s, stamps_s), body_motion(motion.track))
    assert found.ambiguous or abs(found.offset_s - 11.2) < FRAME_S


def test_a_camera_is_plain_data():
    camera: Camera = side_camera()
    assert json.loads(json.dumps(camera.described()))["width_px"] == 320


def test_a_picture_of_more_pixels_than_8k_is_not_decoded(drawn, monkeypatch):
    assert video_info(drawn / "piece.webm").width_px == 160
    monkeypatch.setattr("oarlock.movement.video.reading._MOST_PIXELS", 1000)
    assert_refused(lambda: video_info(drawn / "piece.webm"), "cannot be read as a video")
