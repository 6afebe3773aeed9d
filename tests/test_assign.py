"""`oarlock calibrate units` and its questions: which unit sits where, from movements by hand, by a file."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import oarlock
from command_line import run
from oarlock.calibration import SessionPlan, SessionStep
from oarlock.calibration.assignment.assign import assign_by_movement
from oarlock.cli import app
from oarlock.recording.unit_names import assign_units, read_units_file, renamed
from oarlock.simulation import SessionErrors
from refusals import assert_refused

ANY_ROTATION = SessionErrors(mount_rad=2.5)
ABOUT_Z = (0.0, 0.0, 1.0)
JOINTS = {
    "right_arm": ("shoulder_r", ABOUT_Z, 1),
    "left_arm": ("shoulder_l", ABOUT_Z, 1),
    "right_elbow": ("elbow_flexion_r", None, 1),
    "right_leg": ("hip_flexion_r", None, 1),
    "left_leg": ("hip_flexion_l", None, 1),
    "nod": ("neck_flexion", None, -1),
    "bow": ("pelvis", ABOUT_Z, -1),
}


def moved(name, order, seed, errors=ANY_ROTATION):
    """A recording of movements one after the other with units of any name, and sensor -> unit."""
    body = oarlock.load_model(name)
    moves = [
        SessionStep(m, "move", joints=(JOINTS[m][0],), axis=JOINTS[m][1], first=JOINTS[m][2])
        for m in order.split(",")
    ]
    plan = SessionPlan(
        "one after the other", (SessionStep("start", "pose"), *moves, SessionStep("end", "pose"))
    )
    trial = oarlock.simulation.simulate_session(body, plan, errors, seed=seed)
    ids = np.random.default_rng(seed).permutation(len(trial.recording.names))
    units = {s: f"00B4{k:04X}" for s, k in zip(trial.recording.names, ids, strict=True)}
    return body, renamed(trial.recording, units), units


@pytest.fixture(scope="module")
def legs():
    return moved("lower_body", "right_leg,left_leg", 0)


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("lower_body", "right_leg,left_leg"),
        ("upper_body", "bow,nod,left_arm,right_arm"),
        ("upper_body", "right_arm,right_elbow,left_arm,bow"),
    ],
)
def test_each_unit_is_found(name, order):
    body, recording, units = moved(name, order, 0)
    assert dict(assign_by_movement(body, recording, order).units) == units


def test_sixteen_units():
    order = "right_arm,left_arm,right_leg,left_leg,bow,nod"
    body, recording, units = moved("full_body", order, 1)
    found = assign_by_movement(body, recording, order)
    assert dict(found.units) == units
    assert [name for name, *_ in found.movements] == order.split(",")


def test_distances_from_the_hip(legs):
    body, recording, units = legs
    levers = assign_by_movement(body, recording, "right_leg,left_leg").levers_m
    # Half the thigh; the thigh and half the shank; thigh, shank and a little of the foot. 3 cm of radius.
    for sensor, distance_m in (("thigh_r", 0.21), ("shank_r", 0.645), ("foot_r", 0.863)):
        assert levers[units[sensor]] == pytest.approx(distance_m, rel=0.1, abs=0.03)


def test_another_order_exchanges_the_sides(legs):
    body, recording, units = legs
    found = assign_by_movement(body, recording, "left_leg,right_leg").units
    assert found["thigh_l"] == units["thigh_r"] and found["foot_r"] == units["foot_l"]


def test_a_pause_within_a_movement_is_part_of_it():
    body = oarlock.load_model("lower_body")
    swing = SessionStep("again", "move", joints=("hip_flexion_r",))
    left = SessionStep("left", "move", joints=("hip_flexion_l",))
    rest = SessionStep("rest", "pose")
    steps = (rest, swing, SessionStep("once more", "move", joints=("hip_flexion_r",)), left, rest)
    trial = oarlock.simulation.simulate_session(body, SessionPlan("paused", steps), ANY_ROTATION, seed=4)
    found = assign_by_movement(body, trial.recording, "right_leg,left_leg")
    assert dict(found.units) == {name: name for name in found.units}


def test_movements_that_do_not_tell_units_apart(legs):
    body, recording, _ = legs
    assert_refused(
        lambda: assign_by_movement(body, recording, "right_leg"), "thigh_l, shank_l, foot_l", "left_leg"
    )
    upper, worn, _ = moved("upper_body", "right_arm,left_arm", 0)
    assert_refused(lambda: assign_by_movement(upper, worn, "right_arm,left_arm"), "pelvis, lumbar", "bow")


def test_what_is_unclear_is_refused_with_numbers(legs):
    body, recording, _ = legs
    assert_refused(
        lambda: assign_by_movement(body, recording, "right_leg,left_leg,bow"), "2 were found", "9.0 to"
    )
    first = {"end_s": 20.0}
    assert_refused(
        lambda: assign_by_movement(body, recording, "right_leg,left_leg", **first), "1 were found", "--from"
    )
    assert_refused(lambda: assign_by_movement(body, recording, "right_leg,hop"), '"hop"', "right_arm")
    assert_refused(lambda: assign_by_movement(body, recording, "right_leg,right_leg"), "comes twice")
    assert_refused(lambda: assign_by_movement(body, recording, " , "), "names no movement")
    cut = body.with_units(["pelvis", "thigh_r"])
    assert_refused(lambda: assign_by_movement(cut, recording, "right_leg"), "7 units", "2 sensors", "--units")


def test_legs_that_move_together_could_be_either():
    body = oarlock.load_model("lower_body")
    both = ("hip_flexion_r", "hip_flexion_l")
    moves = (SessionStep("both", "move", joints=both), SessionStep("once more", "move", joints=both))
    steps = (SessionStep("start", "pose"), *moves, SessionStep("end", "pose"))
    trial = oarlock.simulation.simulate_session(body, SessionPlan("both", steps), ANY_ROTATION, seed=0)
    names = ("_r and", "_l", "or the other way round", "right_leg 100 %")
    # A pause between equal movements does not part them, unless two are asked for.
    assert_refused(lambda: assign_by_movement(body, trial.recording, "right_leg,left_leg"), *names)


def test_units_at_one_place_have_no_order():
    body, recording, units = moved("lower_body", "right_leg,left_leg", 0)
    twin = replace(recording[units["shank_r"]], name=units["foot_r"])
    streams = [twin if s.name == units["foot_r"] else s for s in recording.streams]
    same = oarlock.Recording(streams)
    refused = lambda: assign_by_movement(body, same, "right_leg,left_leg")  # noqa: E731
    assert_refused(refused, "their order is unclear", units["shank_r"], "65 cm", "Move faster")


def test_units_of_any_name_get_their_sensors(legs, tmp_path):
    _, recording, units = legs
    recording.save(tmp_path / "rec")
    command = ("calibrate", "units", tmp_path / "rec", "--model", "lower_body")
    out = ("--order", "right_leg,left_leg", "--out", tmp_path / "units.toml")
    said = run(*command, *out, "--write", tmp_path / "named").output
    assert "right leg %" in said and "100" in said and "distance m" in said and "oarlock track" in said
    assert set(oarlock.load_recording(tmp_path / "named").names) == set(units)
    run(*command, *out, status=2)  # the file exists
    told = json.loads(run(*command, *out, "--force", "--json").stdout)
    assert {sensor: row["unit"] for sensor, row in told["units"].items()} == units
    assert told["movements"][1]["name"] == "left_leg"
    assert told["units"]["foot_r"]["right_leg_percent"] > 99.0
    assert told["units"]["foot_r"]["distance_m"] == pytest.approx(0.863, rel=0.1)
    by_file = ("--units", tmp_path / "units.toml", "--write", tmp_path / "by_file")
    run(*command, *by_file)
    again, first = (oarlock.load_recording(tmp_path / name) for name in ("by_file", "named"))
    np.testing.assert_array_equal(again["foot_l"].gyro_rad_s, first["foot_l"].gyro_rad_s)
    assert "--order" in run(*command, "--out", tmp_path / "no.toml", status=2).output
    run(*command, "--order", "right_leg", *by_file, status=2)


def test_a_terminal_leads_through_it(legs, tmp_path, monkeypatch):
    _, recording, units = legs
    recording.save(tmp_path / "rec")
    monkeypatch.setattr("oarlock.cli.calibrate_units.asks_questions", lambda no, json_output: True)

    def typed(answers, out):
        words = ["calibrate", "units", tmp_path / "rec", "--model", "lower_body", "--out", tmp_path / out]
        done = CliRunner().invoke(app, [str(w) for w in words], input=answers, prog_name="oarlock")
        assert done.exit_code == 0, done.output
        return done.output

    said = typed("perhaps\nmovement\nright_leg\nright_leg,left_leg\n", "moved.toml")
    assert "swing the right leg" in said and "do not tell" in said and "full turns" in said
    by_hand = "".join(f"{units[sensor]}\n" for sensor in oarlock.load_model("lower_body").sensor_names)
    said = typed("hand\n00B4\n" + by_hand, "hand.toml")
    assert "several of" in said
    written = {stream: sensor for sensor, stream in units.items()}
    assert read_units_file(tmp_path / "moved.toml") == read_units_file(tmp_path / "hand.toml") == written


def test_a_whole_name_comes_before_a_part_of_it():
    ids = {"sensor1": "pelvis", "sensor10": "thigh_r"}
    found = assign_units(["pelvis", "thigh_r"], ["sensor10", "sensor1"], ids=ids)
    assert dict(found.units) == {"pelvis": "sensor1", "thigh_r": "sensor10"}
