"""A rower on an ergometer: the hands hold one handle, slides move the machine, and both are tracked."""

import numpy as np
import pytest

import oarlock
from exact_recording import ELEVEN
from oarlock.rowing import ErgometerShape, Machine, ergometer_piece
from oarlock.rowing.simulation.boat import rower_centre_of_mass
from oarlock.rowing.simulation.experiment import simulate_ergometer, simulate_rowing
from oarlock.storage.errors import DataError
from refusals import assert_refused

SAME = 1e-12
HELD_M = 1e-6
DIFFERENCED_M_S2 = (
    0.02  # second differences at 250 Hz of a motion up to 10 Hz, of accelerations up to 10 m/s2
)
# Twice what sculling needs: hands on one handle, the first second of the start included.
REACHED_DEG = 0.06
TREE = oarlock.Config(structure="tree")
"""Exact bodies: the structure that takes mounts and lengths as they are."""
FLOOR = oarlock.Config(structure="tree", estimate=("gyro_bias", "accel_bias"))


@pytest.fixture(scope="module")
def model() -> oarlock.Model:
    return oarlock.load_model("ergometer")


def test_the_body_is_the_scullers(model: oarlock.Model) -> None:
    sculler = oarlock.load_model("sculler")
    q = np.random.default_rng(0).uniform(-0.6, 0.6, (10, len(model.joint_names)))
    own = np.zeros((10, len(sculler.joint_names)))
    shared = [name for name in model.joint_names if name in sculler.joint_names]
    own[:, [sculler.joint_names.index(n) for n in shared]] = q[
        :, [model.joint_names.index(n) for n in shared]
    ]
    poses, plain = model.forward_kinematics(q), sculler.forward_kinematics(own)
    for name in ("seat", "r_shoulder", "l_elbow", "r_wrist", "l_hand"):
        there = poses[:, model.frame_names.index(name)]
        assert np.abs(there - plain[:, sculler.frame_names.index(name)]).max() < SAME


def test_the_handle_hangs_on_its_chain(model: oarlock.Model) -> None:
    q = np.zeros((1, len(model.joint_names)))
    q[0, model.joint_names.index("handle")] = 0.7
    q[0, model.joint_names.index("chain_pitch")] = np.radians(30.0)
    frames = model.forward_kinematics(q)[0]
    end = frames[model.frame_names.index("bar"), :3, 3]
    p = model.parameters
    np.testing.assert_allclose(end, [0.0, p["chain_y"] + 0.35, p["chain_z"] - 0.7 * np.cos(np.radians(30.0))])
    right, left = (frames[model.frame_names.index(f"{s}_handle"), :3, 3] for s in "rl")
    np.testing.assert_allclose(left - right, [p["grip_r"] + p["grip_l"], 0.0, 0.0], atol=SAME)


@pytest.mark.parametrize("slides", [False, True])
def test_hands_hold_and_only_slides_move_the_machine(model: oarlock.Model, slides: bool) -> None:
    piece = ergometer_piece(model, 5.0, 26.0, slides=slides, seed=4)
    assert piece.closure_m < HELD_M
    base = piece.motion.base_acceleration_m_s2
    if not slides:
        assert base is None
        return
    # Nothing pushes from outside: the common centre of mass is not accelerated.
    machine, time = Machine(), piece.motion.time_s
    assert base is not None
    centre = rower_centre_of_mass(model, piece.motion.q)
    on_machine = np.gradient(np.gradient(centre, time), time)
    total = machine.machine_kg * base[:, 2] + machine.rower_kg * (base[:, 2] + on_machine)
    assert np.abs(total[5:-5]).max() < DIFFERENCED_M_S2 * (machine.machine_kg + machine.rower_kg)
    assert 1.0 < np.abs(base[:, 2]).max() < 30.0


@pytest.mark.parametrize(("condition", "seed"), [("S-B", 41), ("B-B", 42)], ids=["floor", "slides"])
def test_tracked(model: oarlock.Model, condition: str, seed: int) -> None:
    truth, recording = simulate_ergometer(model, condition, 12.0, (20.0, 30.0), seed)
    config = FLOOR if condition.startswith("S") else TREE
    track = oarlock.track(model, recording, config=config)
    scores = oarlock.evaluate(track, truth)
    assert scores.mean_rmse_deg(ELEVEN) < REACHED_DEG
    # A start with the mirrored hand turns to the right one, which takes some seconds.
    late = track.time_s > 6.5
    for hand in ("r_hand_flexion", "l_hand_flexion"):
        told = np.interp(track.time_s, truth.time_s, truth[hand].angle_rad)
        # The mirrored hand would be off by 20 to 55 deg.
        assert np.degrees(np.abs(track[hand].angle_rad - told)[late]).max() < 15.0


def test_slides_need_surge(model: oarlock.Model) -> None:
    truth, recording = simulate_ergometer(model, "B-B", 8.0, 26.0, 43)
    told = oarlock.evaluate(oarlock.track(model, recording, config=TREE), truth).mean_rmse_deg(ELEVEN)
    floor = oarlock.evaluate(oarlock.track(model, recording, config=FLOOR), truth).mean_rmse_deg(ELEVEN)
    # 2.8 times; equal if the states of the slides had no effect.
    assert floor > 2.0 * told


def test_nonsense_is_refused(model: oarlock.Model) -> None:
    assert_refused(lambda: ErgometerShape(handle_m=(1.5, 0.3)), "handle_m")
    assert_refused(lambda: ErgometerShape(height_m=(0.3, 0.2)), "height_m")
    assert_refused(lambda: Machine(machine_kg=0.0), "machine_kg")
    with pytest.raises(DataError, match="Draw less chain"):
        ergometer_piece(model, 3.0, shape=ErgometerShape(handle_m=(0.1, 1.6)))
    with pytest.raises(ValueError, match="does not pitch"):
        simulate_rowing(model, "B-B", 3.0, pitching=True)
    assert_refused(lambda: ergometer_piece(oarlock.load_model("sculler"), 3.0), "chain_yaw")
