"""A sculler as strapdown links: seat and oars from encoders, hands on handles, surge, mounts and skin as states."""

import pickle
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from exact_recording import ELEVEN, Exact, load_excerpt, read_exact, sculler, silenced
from field_trial import trial
from local_data import local_folder
from oarlock.rowing import FieldEffects, HullRotation
from oarlock.rowing.simulation.experiment import simulate_ergometer, simulate_sculling, simulate_sweep
from oarlock_lab.pages import sculling

TREE = oarlock.Config(structure="tree")
WORN_DEG = 4.0


@cache
def known_body() -> oarlock.Model:
    """A body that is as the model says, and a model that knows so."""
    links = 'links = { joints = "bone_in_rig"'
    assert links in sculler().text
    known = f"{links}, mount_std_rad = 1e-4, skin_std_rad = 1e-4, point_std_m = 1e-4"
    return oarlock.Model.from_toml(sculler().text.replace(links, known), "sculler.toml", {})


def test_a_sculler_that_is_as_the_model_says() -> None:
    """The generator's body is exact: a few tenths of a degree remain of the start, and bands hold them."""
    exact = load_excerpt()
    live = oarlock.track(known_body(), exact.recording, exact.nominal)
    for track in (live, oarlock.smooth(live)):
        scores = sculling.angles(track, exact.truth)
        assert scores.mean_rmse_deg(ELEVEN) < 0.5 and scores.mean_coverage(ELEVEN) > 0.95
    assert not any("never used" in note or "contradict" in note for note in live.notes)


def test_the_seat_is_where_its_encoder_says_and_the_boat_surges() -> None:
    exact = load_excerpt()
    track = oarlock.track(known_body(), exact.recording, exact.nominal)
    seat = np.interp(track.time_s, exact.truth.time_s, exact.truth["seat"].position_m)
    assert np.abs(track["seat"].position_m - seat)[10:-10].max() < 0.005  # its noise is 1 mm
    smoothed = oarlock.smooth(track)
    surge = np.interp(track.time_s, exact.truth.time_s, exact.surge_m_s2)
    late = (track.time_s > 2.0) & (track.time_s < 9.5)
    apart = (smoothed.slow["surge"].value - surge)[late]
    assert np.sqrt(np.mean(apart**2)) < 0.25 and np.std(surge) > 1.5
    assert np.mean(np.abs(apart) < 1.96 * smoothed.slow["surge"].std[late]) > 0.9


def worn(recording: oarlock.Recording, seed: int) -> oarlock.Recording:
    """Every unit turned by some degrees about each axis, as units that are put on by eye."""
    rng = np.random.default_rng(seed)
    streams = []
    for stream in recording:
        turn = Rotation.from_rotvec(np.radians(WORN_DEG) * rng.standard_normal(3))
        values = {key: turn.apply(v.copy()) if v.ndim == 2 else v for key, v in stream.values.items()}
        streams.append(type(stream)(stream.name, stream.time_s, **values))
    return oarlock.Recording(streams)


@pytest.mark.parametrize(
    ("name", "make", "condition"),
    [
        ("sweep", simulate_sweep, "B-B"),
        ("ergometer", simulate_ergometer, "S-B"),
        pytest.param("sculler_boat", partial(simulate_sculling, hull_rotation=HullRotation()), "B-B"),
    ],
)
def test_units_put_on_by_eye_in_any_boat(name: str, make: Any, condition: str) -> None:
    """Mounts are states: a tree, which takes them as they are, is wrong by as much as the units are turned."""
    model = oarlock.load_model(name)
    truth, recording = make(model, condition, 30.0, (20.0, 30.0), 5)
    recording = worn(recording, 5)
    means = []
    for structure in ("strapdown", "tree"):
        track = oarlock.track(model, recording, config=oarlock.Config(structure=structure))
        scores = oarlock.evaluate(track, truth)
        means.append(scores.mean_rmse_deg(ELEVEN))
        if structure == "strapdown":
            assert np.mean([scores[joint].coverage for joint in ELEVEN]) > 0.9
    assert means[0] < 0.75 * means[1], means


def test_a_hull_that_slides_without_encoders_moves_within_its_limits() -> None:
    model = oarlock.load_model("sculler_boat")
    _, recording = simulate_sculling(model, "B-B", 10.0, 26.0, 3, hull_rotation=HullRotation())
    track = oarlock.track(model, recording.without(["waist"]))
    for name, limit_m in (("hull_sway", 0.1), ("hull_heave", 0.04)):
        i = track.joint_names.index(name)
        assert np.abs(track.q[:, i]).max() < limit_m and np.all(track.q_std[:, i] < 0.5 * limit_m + 1e-9)


def test_a_unit_that_was_silent_comes_back_where_it_is() -> None:
    """Its orientation is worth 1 rad then, and must not be put down to its mount: 16 deg were, for good."""
    exact = load_excerpt()
    gap = silenced(exact.recording, "r_upperarm", 4.0, 1.2)
    tracks = [oarlock.track(sculler(), recording, exact.nominal) for recording in (exact.recording, gap)]
    late = tracks[0].time_s > 6.0
    for joint in ("r_shoulder_flexion", "r_shoulder_rotation", "r_elbow_flexion"):
        apart = np.degrees(tracks[1][joint].angle_rad - tracks[0][joint].angle_rad)[late]
        assert np.sqrt(np.mean(apart**2)) < 1.5, joint


def late_deg(track: oarlock.Track, exact: Exact, from_s: float) -> float:
    late = track.time_s > from_s
    apart = [
        track[j].angle_rad[late] - np.interp(track.time_s[late], exact.truth.time_s, exact.truth[j].angle_rad)
        for j in ELEVEN
    ]
    return float(np.degrees(np.sqrt(np.mean(np.square(apart)))))


def test_a_body_is_found_again_after_everything_was_silent() -> None:
    """Encoders and handles show where it is; an estimate that only went on was off by whole turns."""
    exact = load_excerpt()
    gap = exact.recording
    for name in exact.recording.names:
        gap = silenced(gap, name, 4.0, 1.2)
    live = oarlock.track(sculler(), gap, exact.nominal)
    for track in (live, oarlock.smooth(live)):
        assert late_deg(track, exact, 5.7) < 0.6  # 0.2; without the gap 0.2
        assert np.all(np.isfinite(track.q)) and np.all(track.q_std > 0.0)


def test_a_hand_is_not_tied_to_an_oar_that_nothing_measures() -> None:
    """An oar without its streams is not taken to be at rest: the elbow would turn by 14 deg, with a band of 2."""
    exact = load_excerpt()
    names = [name for name in exact.recording.names if name not in ("r_oar_phi", "r_oar_alpha")]
    track = oarlock.track(sculler(), exact.recording.only(names), exact.nominal)
    assert late_deg(track, exact, 2.0) < 1.0  # 0.3


def test_a_start_posture_of_a_rower_is_a_guess() -> None:
    """Encoders and handles decide: 30 deg off everywhere ends where no guess ends."""
    exact = load_excerpt()
    guess = exact.truth.q[0].copy()
    guess[1:14] += 0.5 * np.random.default_rng(0).standard_normal(13)
    track = oarlock.track(sculler(), exact.recording, exact.nominal, oarlock.Config(initial_q=tuple(guess)))
    assert late_deg(track, exact, 0.5) < 0.6


def test_an_estimate_from_before_the_decision_goes_on() -> None:
    """All that is still possible goes with it."""
    exact = load_excerpt()
    before, after = exact.recording.slice(end_s=5.0), exact.recording.slice(start_s=5.0)
    belief = pickle.loads(pickle.dumps(oarlock.track(sculler(), before, exact.nominal).last_belief))
    whole, rest = (
        oarlock.track(sculler(), exact.recording, exact.nominal),
        oarlock.track(sculler(), after, exact.nominal, start=belief),
    )
    last = [track["r_elbow_flexion"].angle_rad[-1] for track in (whole, rest)]
    assert np.degrees(abs(last[0] - last[1])) < 0.2  # a few samples at the seam are read otherwise


@pytest.mark.long
def test_units_that_do_not_move_on_their_bones_are_told_from_such_that_do() -> None:
    """Skin is there unless the first 20 s of movement say otherwise; then mounts may be off, or not even these."""
    effects = [FieldEffects.misfit(), FieldEffects()]
    misfit, careful = (trial(effect, "B-B", duration_s=30.0, rate_spm=24.0, seed=7) for effect in effects)
    notes = [oarlock.track(sculler(), one.recording).notes for one in (misfit, careful)]
    says = [[note for note in some if "between units and bones" in note] for some in notes]
    assert ["lengths are estimated" in note for note in says[0]] == [True] and says[1] == []
    exact = read_exact(local_folder("recordings") / "exact_B-B_0.npz", "exact")
    track = oarlock.track(sculler(), exact.recording, exact.nominal)
    assert any("as the model says" in note for note in track.notes)
    for one, bar_deg in ((track, 0.1), (oarlock.smooth(track), 0.06)):  # 0.07 and 0.04
        assert sculling.angles(one, exact.truth).mean_rmse_deg(ELEVEN) < bar_deg


@pytest.mark.long
@pytest.mark.parametrize("seed", [11, 12])
def test_a_body_that_is_not_as_modelled(seed: int) -> None:
    """Three seeds of the field simulator had 2.29 deg where the tree has 3.03, and bands of 95 % held 100 %."""
    one = trial(FieldEffects(), "B-B", duration_s=30.0, rate_spm=24.0, seed=seed)
    by_links, by_tree = (
        sculling.angles(oarlock.track(sculler(), one.recording, config=config), one.truth)
        for config in (None, TREE)
    )
    assert by_links.mean_rmse_deg(ELEVEN) < by_tree.mean_rmse_deg(ELEVEN)
    assert by_links.mean_coverage(ELEVEN) > 0.92


@pytest.mark.long
@pytest.mark.parametrize("name", ["wild_0", "wild_7", "misfit_0"])
def test_mounts_and_skin_are_worth_more_than_a_rigid_tree(name: str) -> None:
    """Nominal lengths and mounts: live, links have 2.34, 2.46 and 0.99 deg, the tree 3.34, 3.00 and 2.57."""
    body = read_exact(local_folder("recordings") / f"{name}.npz", name)
    by_links, by_tree = (
        sculling.angles(
            oarlock.track(sculler(), body.recording, body.nominal, config), body.truth
        ).mean_rmse_deg(ELEVEN)
        for config in (None, TREE)
    )
    assert by_links < 0.85 * by_tree
