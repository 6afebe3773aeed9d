"""`calibrate_sagittal`: mounts of any orientation from standing still and mostly sagittal movement."""

from dataclasses import replace

import numpy as np
import pytest

import oarlock
from command_line import run
from local_data import local_folder
from oarlock import Recording
from refusals import assert_refused
from walking_body import STILL_S, walk

LEGS = ("thigh_r", "shank_r", "foot_r", "thigh_l", "shank_l", "foot_l")
# Six units of five people, in the long tier: twice the stated standard deviation leaves room for one in twenty.
WITHIN_STDS = 2.0
# A homogeneous field has one north; what is left is the heading of the legs, half left and half right.
NORTH_RAD = np.radians(3.0)


@pytest.fixture(scope="module")
def model():
    return oarlock.load_model("lower_body")


@pytest.fixture(scope="module", params=[2, pytest.param(5, marks=pytest.mark.long)], ids=["two", "five"])
def walks(request):
    """As many people as given."""
    return [walk(seed) for seed in range(request.param)]


@pytest.fixture(scope="module")
def found(model, walks):
    return [oarlock.calibration.calibrate_sagittal(model, one.recording) for one in walks]


def headings(found):
    return {name: unit["heading_by"] for name, unit in found.noted["sensor"].items()}


def test_headings_agree_with_their_standard_deviations(walks, found):
    errors, stds = [], []
    for one, cal in zip(walks, found, strict=True):
        off = one.heading_errors_rad(cal)
        for name in LEGS:
            assert cal.noted["sensor"][name]["heading_by"] == "movement"
            errors.append(off[name])
            stds.append(cal.noted["sensor"][name]["heading_std_rad"])
            # up is Y of every link; the rest of the uncertainty is that of the posture
            assert cal.mount_stds_rad[name][1] == pytest.approx(stds[-1], rel=0.01)
    scores = np.abs(errors) / np.array(stds)
    assert (scores < WITHIN_STDS).mean() >= 0.95
    assert np.sqrt(np.mean(scores**2)) < 1.0 + 2.0 / np.sqrt(2 * len(scores))


def test_which_side_is_forward_is_right_for_every_leg(walks, found):
    for one, cal in zip(walks, found, strict=True):
        off = one.heading_errors_rad(cal)
        assert max(abs(off[name]) for name in LEGS) < np.pi / 4


def test_inclinations_are_right(walks, found):
    for one, cal in zip(walks, found, strict=True):
        headings_rad, errors_rad = one.heading_errors_rad(cal), one.errors_rad(cal)
        for name in one.calibration.mounts:
            # The posture is exact here, so what remains of the error is noise of the rest.
            assert errors_rad[name] == pytest.approx(abs(headings_rad[name]), abs=np.radians(0.5))


def test_the_first_rest_is_found(found):
    for cal in found:
        start_s, end_s = cal.noted["still_s"]
        assert start_s < 0.1 and STILL_S - 0.2 < end_s < STILL_S + 0.7


def test_a_unit_that_turns_about_no_axis_takes_the_north_of_the_others(model):
    one = walk(1, with_magnetometers=True)
    cal = oarlock.calibration.calibrate_sagittal(model, one.recording)
    assert headings(cal) == {"pelvis": "north"} | dict.fromkeys(LEGS, "movement")
    assert abs(one.heading_errors_rad(cal)["pelvis"]) < NORTH_RAD
    assert cal.noted["sensor"]["pelvis"]["heading_std_rad"] > np.radians(15.0)


def test_without_magnetometers_it_keeps_the_nominal_heading_and_says_so(found):
    for cal in found:
        assert headings(cal)["pelvis"] == "nominal"
        assert cal.noted["sensor"]["pelvis"]["heading_std_rad"] == pytest.approx(np.pi / np.sqrt(3.0))
        assert cal.mount_stds_rad["pelvis"][1] == pytest.approx(np.pi / np.sqrt(3.0), rel=0.01)


def test_a_magnetometer_of_its_own_rate_gives_the_same_north(model):
    one = walk(1, with_magnetometers=True)
    slow = []
    for stream in one.recording:
        mag = np.array(stream.mag_ut)
        mag[np.arange(len(mag)) % 5 != 0] = np.nan
        slow.append(replace(stream, mag_ut=mag))
    every = oarlock.calibration.calibrate_sagittal(model, one.recording)
    fifth = oarlock.calibration.calibrate_sagittal(model, Recording(slow))
    np.testing.assert_allclose(
        fifth.mounts["pelvis"][0], every.mounts["pelvis"][0], rtol=0, atol=np.radians(0.1)
    )


def test_nobody_moves(model):
    still = walk(0, swing=0.0, leaning_rad=0.0)
    assert_refused(
        lambda: oarlock.calibration.calibrate_sagittal(model, still.recording),
        "no unit turns by 17 deg with 75 % about one level axis",
        "thigh_r: turned through 0 deg",
        "Walk or squat",
        "oarlock calibrate session",
    )


def test_a_stretch_may_be_named_and_units_chosen(model, walks):
    cal = oarlock.calibration.calibrate_sagittal(
        model, walks[0].recording, still_s=(0.5, 2.5), sensors=["thigh_r", "shank_r"]
    )
    assert cal.noted["still_s"] == pytest.approx([0.5, 2.5], abs=0.02)
    assert set(cal.noted["sensor"]) == {"thigh_r", "shank_r"}
    off = walks[0].heading_errors_rad(cal)
    assert max(abs(off[name]) for name in ("thigh_r", "shank_r")) < np.pi / 4


def test_knees_of_the_walk_come_back(model, walks, found):
    one = walks[0]
    track = oarlock.smooth(oarlock.track(model, one.recording, found[0]))
    for knee in ("knee_flexion_r", "knee_flexion_l"):
        true = np.interp(track.time_s, one.truth.time_s, one.truth[knee].angle_rad)
        off = track[knee].angle_rad - true
        assert np.sqrt(np.mean(off**2)) < np.radians(6.0)


@pytest.mark.data
def test_seven_units_on_hips_and_legs(tmp_path):
    """Knees of somebody who walked, from x-io units without any knowledge of how they were worn."""
    place = local_folder("data/xio_imumocap_lower_body")
    run("import", place, "--model", "lower_body", "--no-questions", "--out", tmp_path / "rec")
    model = oarlock.load_model("lower_body", stature_m=1.78, mass_kg=75.0)
    recording = oarlock.load_recording(tmp_path / "rec")
    cal = oarlock.calibration.calibrate_sagittal(model, recording)
    assert {name: how for name, how in headings(cal).items() if name in LEGS} == dict.fromkeys(
        LEGS, "movement"
    )
    track = oarlock.track(model, recording.low_passed(6.0), cal)
    for knee in ("knee_flexion_r", "knee_flexion_l"):
        angle_deg = np.degrees(track[knee].angle_rad)
        assert angle_deg.min() > -10.0 and angle_deg.max() < 145.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("side", "rl")
def test_a_leg_alone_faces_forward_where_its_knee_bends_far(seed, side):
    """The slow beginning of a movement is no rest: its rates in the gyroscope's bias move knees past their limits."""
    one = walk(seed)
    worn = [f"{part}_{side}" for part in ("thigh", "shank", "foot")]
    leg = oarlock.load_model("lower_body").with_units(worn)
    found = oarlock.calibration.calibrate_sagittal(leg, one.recording.only(worn))
    assert set(headings(found).values()) == {"movement"}
    assert max(map(abs, one.heading_errors_rad(found).values())) < 3.0 * np.radians(8.0), (
        "8 deg: how far the plane of movement is off"
    )


def test_legs_without_a_pelvis_may_face_either_way():
    """A thigh alone swings as far back as forward, and its knee allows both, so the search must not claim to know."""
    one = walk(2, swing=0.5)
    worn = ["thigh_r", "shank_r", "foot_r"]
    leg = oarlock.load_model("lower_body").with_units(worn)
    found = oarlock.calibration.calibrate_sagittal(leg, one.recording.only(worn))
    assert headings(found)["thigh_r"] == "movement, either way"
    assert found.noted["sensor"]["thigh_r"]["heading_std_rad"] == pytest.approx(np.pi / np.sqrt(3.0))
