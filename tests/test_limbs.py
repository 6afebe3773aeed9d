"""A tree cut into limbs: which joints go where, sub-models that predict as the whole does, and one track of all."""

import numpy as np
import pytest

import oarlock
from exact_recording import at_rate
from oarlock import Config, DataError, Recording
from oarlock.evaluation.comparison.limbs import SHARED, Limb, cut_into_limbs
from oarlock.rowing.simulation.experiment import simulate_sculling

# The same kinematics from the same numbers, once written to a file and read again.
SAME = 1e-12


@pytest.fixture(scope="module")
def sculler() -> oarlock.Model:
    return oarlock.load_model("sculler", parameters={"l_ua_r": 0.33})


@pytest.fixture(scope="module")
def rowed(sculler: oarlock.Model) -> tuple[oarlock.Track, Recording]:
    return simulate_sculling(sculler, "B-B", duration_s=5.0, seed=21)


def by_name(limbs: tuple[Limb, ...]) -> dict[str, Limb]:
    return {limb.name: limb for limb in limbs}


def test_a_sculler_has_two_arms_and_what_carries_them(sculler):
    limbs = by_name(cut_into_limbs(sculler))
    assert list(limbs) == [SHARED, "r_shoulder_abduction", "l_shoulder_abduction"]
    assert limbs[SHARED].own == ("seat", "trunk")
    assert limbs[SHARED].model.sensor_names == ["back", "seat"]
    right = limbs["r_shoulder_abduction"]
    arm = [n for n in sculler.joint_names if n.startswith(("r_shoulder", "r_elbow", "r_hand"))]
    assert len(arm) == 7
    assert right.own == (*arm, "r_oar_phi", "r_oar_alpha", "r_oar_theta")
    assert right.model.joint_names == ["seat", "trunk", *right.own]
    assert right.model.closure_names == ["r_grip"]
    assert right.model.sensor_names == ["back", "r_upperarm", "r_forearm", "seat", "r_oar_phi", "r_oar_alpha"]


def test_without_closures_limbs_end_freely(sculler):
    limbs = by_name(cut_into_limbs(sculler, closures=False))
    left = limbs["l_shoulder_abduction"]
    assert left.model.closure_names == []
    assert not any("oar" in name for name in left.model.joint_names)
    assert len(left.own) == 7


def test_a_body_on_a_free_hip():
    limbs = by_name(cut_into_limbs(oarlock.load_model("qmt_full_body")))
    assert limbs[SHARED].own == ("hip", "lumbar", "thoracic")
    assert limbs["shoulder_left"].own == ("shoulder_left", "elbow_left", "wrist_left")
    assert limbs["neck"].model.joint_names == ["hip", "lumbar", "thoracic", "neck"]


@pytest.mark.parametrize("name", ["sculler", "sculler_ball", "qmt_full_body"])
def test_each_joint_is_answered_for_once(name):
    model = oarlock.load_model(name)
    own = [joint for limb in cut_into_limbs(model) for joint in limb.own]
    assert sorted(own) == sorted(model.joint_names)


@pytest.mark.parametrize("name", ["sculler", "sculler_ball", "qmt_full_body"])
@pytest.mark.parametrize("closures", [True, False])
def test_sub_models_predict_what_the_whole_predicts(name, closures):
    parameters = {"l_fa_l": 0.29} if name == "sculler" else None
    model = oarlock.load_model(name, parameters=parameters)
    random = np.random.default_rng(3)
    q, qd, qdd = (random.uniform(-1.0, 1.0, (5, len(model.coordinate_names))) for _ in range(3))
    whole = dict(zip(model.measurement_names, model.predict_measurements(q, qd, qdd).T, strict=True))
    for limb in cut_into_limbs(model, closures):
        columns = [model.coordinate_names.index(c) for c in limb.model.coordinate_names]
        part = limb.model.predict_measurements(*(x[:, columns] for x in (q, qd, qdd)))
        assert limb.model.measurement_names
        for row, values in zip(limb.model.measurement_names, part.T, strict=True):
            assert np.abs(values - whole[row]).max() < SAME * max(1.0, np.abs(values).max())


def test_one_chain_has_no_limbs():
    with pytest.raises(DataError, match=r"one chain.*Use ukf"):
        cut_into_limbs(oarlock.load_model("pendulum3"))


def test_limbs_are_tracked_each_by_itself(sculler, rowed):
    truth, recording = rowed
    track = oarlock.studies.track_independent_chains(sculler, recording)
    shared = by_name(cut_into_limbs(sculler))[SHARED].model
    alone = oarlock.track(shared, recording.only(shared.sensor_names), config=Config(structure="tree"))
    # what is shared knows nothing of the arms
    assert np.array_equal(track["trunk"].angle_rad, alone["trunk"].angle_rad)
    scores = oarlock.evaluate(track, truth)
    # a simulated recording without any fault in the model: the tree reaches 0.03 deg
    assert scores["r_shoulder_flexion"].rmse < np.radians(0.2)
    assert scores.states is not None
    assert 0.2 < scores.states.nees < 2.0
    assert track.frame_positions("r_wrist").shape == (len(track.time_s), 3)
    assert track.beliefs is not None
    states = list(track.beliefs.state_names)
    across = track.beliefs.covariance[:, states.index("r_elbow_flexion"), states.index("l_elbow_flexion")]
    assert (across == 0.0).all()


def test_limbs_at_different_rates_and_with_gaps_make_one_track(sculler, rowed):
    truth, recording = rowed
    right = [name for name in recording.names if name.startswith("r_")]
    slow = {s.name: s for s in at_rate(recording.only(right), 50.0)}
    mixed = Recording([slow.get(s.name, s) for s in recording])
    track = oarlock.studies.track_independent_chains(sculler, mixed)
    assert np.all(np.diff(track.time_s) > 0)
    scores = oarlock.evaluate(track, truth)
    assert scores["r_elbow_flexion"].rmse < np.radians(0.3)
    assert scores["l_elbow_flexion"].rmse < np.radians(0.2)


def test_a_limb_without_any_stream_is_named(sculler, rowed):
    only_right = rowed[1].only(["r_upperarm", "r_forearm"])
    with pytest.raises(DataError, match=r'limb "shared".*back'):
        oarlock.studies.track_independent_chains(sculler, only_right, config=Config(closures=False))
