"""A seat's rail that slopes: what it does to the body, what it costs when nobody knows, and that tracking finds it."""

import numpy as np
import pytest

import oarlock
from exact_recording import ELEVEN, TREE
from oarlock.rowing import on_unknown_rail
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.storage.errors import DataError

SAME = 1e-12
TWO_DEG = float(np.radians(2.0))
# As sculling on a level rail, with room for the seed.
REACHED_DEG = 0.045
FOUND_RAD = float(np.radians(0.1))


@pytest.mark.parametrize(("name", "boat"), [("sculler", "root"), ("sculler_boat", "hull")])
def test_the_seat_rises_and_the_trunk_stays_upright(name: str, boat: str) -> None:
    flat, sloping = (
        oarlock.load_model(name),
        oarlock.load_model(name, parameters={"rail_slope_rad": TWO_DEG}),
    )
    assert flat.parameters["rail_slope_rad"] == 0.0
    q = np.zeros((1, len(flat.joint_names)))
    q[0, flat.joint_names.index("seat")] = 0.5
    before, after = (m.forward_kinematics(q)[0] for m in (flat, sloping))
    moved = after[:, :3, 3] - before[:, :3, 3]
    lifted = [0.0, 0.5 * np.sin(TWO_DEG), 0.5 * (np.cos(TWO_DEG) - 1.0)]
    for frame in ("seat", "r_shoulder", "l_hand"):
        np.testing.assert_allclose(moved[flat.frame_names.index(frame)], lifted, atol=SAME)
    for frame in (boat, "r_oarlock", "l_handle"):
        np.testing.assert_allclose(moved[flat.frame_names.index(frame)], 0.0, atol=SAME)
    shoulder = flat.frame_names.index("r_shoulder")
    np.testing.assert_allclose(after[shoulder, :3, :3], before[shoulder, :3, :3], atol=SAME)


@pytest.mark.parametrize("name", ["sculler", "sculler_boat", "ergometer"])
def test_an_unknown_rail_moves_as_a_known_one(name: str) -> None:
    known = oarlock.load_model(name, parameters={"rail_slope_rad": TWO_DEG})
    free = on_unknown_rail(oarlock.load_model(name))
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (5, len(known.joint_names)))
    own = np.zeros((5, len(free.joint_names)))
    own[:, [free.joint_names.index(joint) for joint in known.joint_names]] = q
    own[:, free.joint_names.index("rail_slope")] = TWO_DEG
    poses, same = known.forward_kinematics(q), free.forward_kinematics(own)
    for k, frame in enumerate(known.frame_names):
        assert np.abs(poses[:, k] - same[:, free.frame_names.index(frame)]).max() < SAME
    assert on_unknown_rail(free) is free


def test_a_slope_costs_when_nobody_knows_it_and_is_found() -> None:
    flat = oarlock.load_model("sculler")
    sloping = oarlock.load_model("sculler", parameters={"rail_slope_rad": TWO_DEG})
    truth, recording = simulate_sculling(sloping, "B-B", 12.0, (20.0, 34.0), 31)
    errors = {}
    for key, model in {"unknown": flat, "told": sloping, "found": on_unknown_rail(flat)}.items():
        track = oarlock.track(model, recording, config=None if key == "found" else TREE)
        errors[key] = oarlock.evaluate(track, truth).mean_rmse_deg(ELEVEN)
    assert errors["told"] < REACHED_DEG
    assert errors["found"] < REACHED_DEG
    assert errors["unknown"] > 4.0 * errors["told"]
    assert abs(track["rail_slope"].angle_rad[-1] - TWO_DEG) < FOUND_RAD


def test_a_body_without_such_a_seat_is_refused() -> None:
    with pytest.raises(DataError, match="rail_slope_rad"):
        on_unknown_rail(oarlock.load_model("arm7"))
