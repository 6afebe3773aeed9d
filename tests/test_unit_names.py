"""Names and device ids of inertial units, matched with the sensors of a model."""

import json

import numpy as np
import pytest

import oarlock
from command_line import run
from local_data import local_folder
from oarlock.formats.contents import import_recording
from oarlock.recording.unit_names import (
    SegmentSide,
    assign_units,
    parsed_units,
    place_of_name,
    read_units_file,
    renamed,
    with_unit_names,
)

BODY = [
    *("pelvis", "lumbar", "thorax", "head"),
    *(f"{s}_{side}" for side in "rl" for s in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")),
]


@pytest.mark.parametrize(
    ("name", "segment", "side"),
    [
        ("r_forearm", "forearm", "r"),
        ("RightForeArm", "forearm", "r"),
        ("left_fore_arm", "forearm", "l"),
        ("LLA", "forearm", "l"),
        ("RUL", "thigh", "r"),
        ("Right Upper Leg 64F61C2E", "thigh", "r"),
        ("Left Lower Leg 64F61CB3 (UDP)", "shank", "l"),
        ("RightUpLeg", "thigh", "r"),
        ("foot_lt", "foot", "l"),
        ("humerus_r_imu", "upper_arm", "r"),
        ("calcn_l_imu", "foot", "l"),
        ("lower_back", "lumbar", ""),
        ("upper_back", "thorax", ""),
        ("Hips", "pelvis", ""),
        ("L5", "lumbar", ""),
        ("T8", "thorax", ""),
        ("radius", "forearm", ""),
        ("MT_012005D6_009-001_00B421E6", "", ""),
        ("imu_1", "", ""),
        ("chair", "", ""),
    ],
)
def test_places_in_names(name, segment, side):
    assert place_of_name(name) == SegmentSide(segment, side)


def test_every_sensor_name_says_its_own_place():
    assert [assign_units(BODY, [name]).units for name in BODY] == [{name: name} for name in BODY]


@pytest.mark.parametrize("model", ["full_body", "upper_body", "lower_body", "arm", "trunk", "qmt_full_body"])
def test_names_of_bodies_that_ship_are_told_apart(model):
    sensors = [sensor.name for sensor in oarlock.load_model(model).describe().inertial_units]
    for name in sensors:
        assert place_of_name(name).segment, name
        assert assign_units(sensors, [f"{name}_00B421E6"]).units == {name: f"{name}_00B421E6"}


def test_recordings_of_people_find_their_sensors():
    arm = import_recording(local_folder("data/opensimrt_upper_limb_ngimu") / "ngimu_data.csv")
    sensors = [sensor.name for sensor in oarlock.load_model("arm").describe().inertial_units]
    assert with_unit_names(arm, sensors)[0].names == ("thorax", "upper_arm_r", "forearm_r")
    legs = [sensor.name for sensor in oarlock.load_model("lower_body").describe().inertial_units]
    names = [
        "left_foot",
        "left_lower_leg",
        "left_upper_leg",
        "right_foot",
        "right_lower_leg",
        "right_upper_leg",
    ]
    found = assign_units(legs, [*names, "pelvis"])
    assert (
        not found.unused and found.units["thigh_l"] == "left_upper_leg" and found.units["pelvis"] == "pelvis"
    )


@pytest.mark.parametrize("model", ["qmt", "noitom", "opensense"])
def test_a_whole_body_in_the_words_of_makers(model):
    words = {
        "qmt": ("hip", "lower_back", "upper_back", "head", "{s}_{d}"),
        "noitom": ("Hips", "Spine", "Spine2", "Head", "{D}{N}"),
        "opensense": ("pelvis_imu", "lumbar_imu", "torso_imu", "head_imu", "{b}_{c}_imu"),
    }[model]
    makers = {
        "upper_arm": "Arm",
        "forearm": "ForeArm",
        "hand": "Hand",
        "thigh": "UpLeg",
        "shank": "Leg",
        "foot": "Foot",
    }
    bones = {
        "upper_arm": "humerus",
        "forearm": "ulna",
        "hand": "hand",
        "thigh": "femur",
        "shank": "tibia",
        "foot": "calcn",
    }
    plain = {"thigh": "upper_leg", "shank": "lower_leg"}
    streams = list(words[:4])
    for c, d in (("r", "right"), ("l", "left")):
        for s in makers:
            streams.append(
                words[4].format(s=plain.get(s, s), d=d, D=d.capitalize(), N=makers[s], b=bones[s], c=c)
            )
    sensors = [s for s in BODY if s != "lumbar"] if model == "noitom" else BODY
    used = [s for s in streams if s != "Spine"]
    assert list(assign_units(sensors, used).units.values()) == used


def test_one_arm_needs_no_side_and_two_arms_do():
    one = ["thorax", "upper_arm_r", "forearm_r", "hand_r"]
    found = assign_units(one, ["thorax", "humerus", "radius"])
    assert found.units == {"thorax": "thorax", "upper_arm_r": "humerus", "forearm_r": "radius"}
    assert found.free == ("hand_r",) and found.reasons["forearm_r"] == '"forearm" in its name'
    with pytest.raises(oarlock.DataError, match="--units upper_arm_r=humerus or --units upper_arm_l=humerus"):
        assign_units(BODY, ["thorax", "humerus", "radius"])
    by_hand = {"upper_arm_l": "humerus", "forearm_l": "radius"}
    assert assign_units(BODY, ["thorax", "humerus", "radius"], by_hand).units == {
        "thorax": "thorax",
        **by_hand,
    }


def test_device_ids_and_hands(tmp_path):
    (tmp_path / "units.toml").write_text('[units]\n00B421E6 = "right forearm"\n"00B421ED" = "thorax"\n')
    ids = read_units_file(tmp_path / "units.toml")
    streams = ["mt_00b421e6", "mt_00b421ed", "mt_00b42279"]
    found = assign_units(BODY, streams, {"pelvis": "42279"}, ids)
    assert found.units == {"pelvis": "mt_00b42279", "thorax": "mt_00b421ed", "forearm_r": "mt_00b421e6"}
    assert found.reasons["forearm_r"] == 'id 00B421E6 is "right forearm"'
    assert assign_units(BODY, streams).unused == tuple(streams)


@pytest.mark.parametrize(
    ("by_hand", "streams", "reason"),
    [
        ({"pelvs": "a"}, ["a"], 'no inertial unit "pelvs". Did you mean "pelvis"'),
        ({"pelvis": "b"}, ["a"], 'no stream contains "b"'),
        ({"pelvis": "a"}, ["a1", "a2"], "several streams contain"),
        ({"pelvis": "a", "thorax": "a"}, ["a"], "given to two sensors"),
        ({}, ["hip", "Pelvis"], 'both mean the sensor "pelvis"'),
    ],
)
def test_refusals_list_the_choices(by_hand, streams, reason):
    with pytest.raises(oarlock.DataError) as refusal:
        assign_units(BODY, streams, by_hand)
    assert reason in str(refusal.value)


def test_what_is_typed():
    assert parsed_units(["pelvis=00B4, thorax = b"]) == {"pelvis": "00B4", "thorax": "b"}
    for text in ("pelvis", "pelvis=", "=b", "pelvis=a,pelvis=b"):
        with pytest.raises(oarlock.DataError, match="--units"):
            parsed_units([text])


def recording(*names):
    time_s = np.arange(5) / 50.0
    up = np.tile([0.1, 9.8, 0.0], (5, 1))
    lost = {"after_s": [0.0], "packets": [1.0], "step_s": [0.02]}
    return oarlock.Recording(
        [oarlock.recording.ImuStream(name, time_s, accel_m_s2=up) for name in names],
        {"packets": {names[0]: lost}},
    )


def test_streams_get_the_sensors_names():
    found, assignment = with_unit_names(recording("RightForeArm", "x"), BODY)
    assert found.names == ("forearm_r", "x") and assignment.unused == ("x",)
    assert list(found.meta["packets"]) == ["forearm_r"]
    assert with_unit_names(recording("a_00B4", "x"), None, {}, {"00b4": "pelvis"})[0].names == ("pelvis", "x")
    with pytest.raises(oarlock.DataError, match="Say which is which: --units pelvis=a"):
        with_unit_names(recording("a", "b"), BODY)
    with pytest.raises(oarlock.DataError, match="two streams have the name"):
        renamed(recording("a", "b"), {"a": "b"})


def test_orientations_follow_their_unit():
    time_s = np.arange(5) / 50.0
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))
    unit = recording("Hips")["Hips"]
    both = oarlock.Recording([unit, oarlock.recording.OrientationStream("Hips_orientation", time_s, quat)])
    assert with_unit_names(both, BODY)[0].names == ("pelvis", "pelvis_orientation")
    alone = oarlock.Recording([oarlock.recording.OrientationStream("tibia_r_imu", time_s, quat)])
    assert with_unit_names(alone, BODY)[0].names == ("shank_r",)


def test_typed(tmp_path):
    from test_table import HEADER, columns_of, table

    header = [HEADER[0], *(f"Upper_{name}" for name in HEADER[1:])]
    (tmp_path / "a.csv").write_text(table(header, columns_of()))
    said = run("import", tmp_path / "a.csv", "--out", tmp_path / "rec", "--units", "middle=upper").stdout
    assert "by hand" in said and oarlock.load_recording(tmp_path / "rec").names == ("middle",)
    said = run("import", tmp_path / "a.csv", "--out", tmp_path / "b", "--model", "pendulum3").stdout
    assert oarlock.load_recording(tmp_path / "b").names == ("upper",) and "same name" in said
    (tmp_path / "units.toml").write_text('upper = "lower"\n')
    run("import", tmp_path / "a.csv", "--out", tmp_path / "c")
    assert oarlock.load_recording(tmp_path / "c").names == ("lower",)
    run("import", tmp_path / "a.csv", "--out", tmp_path / "d", "--units", "upper", status=2)
    words = ("--model", "pendulum3", "--units", "lower=upper", "--json", "--force")
    told = json.loads(run("import", tmp_path / "a.csv", "--out", tmp_path / "b", *words).stdout)
    assert told["units"] == {"lower": {"unit": "upper", "reason": "by hand"}}
    assert told["free_sensors"] == ["upper", "middle"] and told["unused_files"] == []
