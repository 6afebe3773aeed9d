"""Models that are made from others: files that extend a base, and edits in Python."""

import json
import pickle
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import oarlock
from oarlock import ModelError
from oarlock.model.edit import merged
from oarlock.model.shipped_files import model_path
from refusals import assert_refused

ROWERS = ("sculler_ball", "sculler_table2", "sculler_boat", "ergometer", "sweep", "sweep_starboard")


def written(folder, text, name="own.toml"):
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def load(folder, text, name="own.toml"):
    return oarlock.load_model(written(folder, text, name))


HEAD = 'format = 1\nname = "own"\ndescription = "mine"\nextends = "sculler"\n'


@pytest.mark.parametrize("name", ROWERS)
def test_rowers_that_extend_others_hold_their_whole_text(name):
    model = oarlock.load_model(name)
    assert "extends" in tomllib.loads(model_path(name).read_text(encoding="utf-8"))
    document = tomllib.loads(model.text)
    assert not {"extends", "remove"} & set(document)
    again = oarlock.Model.from_toml(model.text, model.path, {})
    assert again.describe().to_dict() == model.describe().to_dict()
    assert pickle.loads(pickle.dumps(model)).describe() == model.describe()


def test_rowers_share_the_scullers_arms():
    sculler = oarlock.load_model("sculler")
    described = {f.name: f for f in sculler.describe().frames}
    for name in ("sweep", "ergometer", "sculler_boat"):
        own = {f.name: f for f in oarlock.load_model(name).describe().frames}
        assert all(
            own[f] == described[f] for f in ("r_elbow", "r_forearm_pronated", "l_elbow") if f in described
        )


def test_a_file_names_only_what_differs(tmp_path):
    sculler = oarlock.load_model("sculler")
    own = load(
        tmp_path,
        HEAD
        + """
[remove]
sensor = ["r_upperarm"]
[parameters]
l_b = 0.6
l_ua_r = { std = 0.001 }
[world]
magnetic_norm_ut = 50.0
[[sensor]]
name = "back"
mag_std_ut = 9.0
[[sensor]]
name = "neck"
after = "back"
kind = "imu"
frame = "r_shoulder"
gyro_std_rad_s = 0.01
""",
    )
    names = [name for name in sculler.sensor_names if name != "r_upperarm"]
    names.insert(names.index("back") + 1, "neck")
    assert own.sensor_names == names
    described, before = own.describe(), sculler.describe()
    parameters = {p.name: p for p in described.parameters}
    assert (parameters["l_b"].value, parameters["l_b"].unit) == (0.6, "m")
    assert parameters["l_ua_r"].std == 0.001
    assert described.world == replace(before.world, magnetic_norm_ut=50.0)
    back = next(s for s in described.sensors if s.name == "back")
    assert back == replace(next(s for s in before.sensors if s.name == "back"), mag_std_ut=9.0)
    assert described.joints == before.joints


def test_a_file_extends_a_file_beside_it(tmp_path):
    written(tmp_path, HEAD + "[parameters]\nl_b = 0.6\n", "middle.toml")
    own = load(tmp_path, 'format = 1\nname = "top"\nextends = "middle.toml"\n[parameters]\nl_cl_r = 0.2\n')
    assert (own.name, own.parameters["l_b"], own.parameters["l_cl_r"]) == ("top", 0.6, 0.2)
    assert own.parameters["l_cl_l"] == oarlock.load_model("sculler").parameters["l_cl_l"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD.replace('"sculler"', '"scoller"'), ["own.toml:4: extends", "'scoller'", "sculler"]),
        (HEAD.replace('"sculler"', "3"), ["own.toml:4: extends", "expected the name"]),
        (HEAD.replace('"sculler"', '"own.toml"'), ["own.toml:4: extends", "in a circle"]),
        (HEAD + '[remove]\nsensor = ["bakc"]\n', ["own.toml", 'no sensor "bakc"', "back"]),
        (HEAD + '[[sensor]]\nname = "x"\nafter = "nobody"\n', ["own.toml", 'no sensor "nobody"']),
        (HEAD + '[[sensor]]\nkind = "imu"\n', ["own.toml", "has no name"]),
        (HEAD + '\n[[sensor]]\nname = "back"\nframe = "nowhere"\n', ["own.toml:8:", "no frame `nowhere`"]),
        (HEAD + '[[remove]]\nsensor = "x"\n', ["own.toml", "remove"]),
        (HEAD + '[remove]\nwheel = ["x"]\n', ["own.toml", "remove.wheel"]),
    ],
)
def test_mistakes_name_their_file_and_line(text, words, tmp_path):
    assert_refused(lambda: load(tmp_path, text), *words, error=ModelError)


def test_files_that_extend_each_other_are_refused(tmp_path):
    written(tmp_path, HEAD.replace('"sculler"', '"own.toml"'), "other.toml")
    with pytest.raises(ModelError, match="in a circle"):
        load(tmp_path, HEAD.replace('"sculler"', '"other.toml"'))


def test_a_mistake_of_the_base_names_the_base(tmp_path):
    text = model_path("arm7").read_text(encoding="utf-8")
    base = written(tmp_path, text.replace('joint = "', 'joint = "un', 1), "base.toml")
    with pytest.raises(ModelError, match=r"base\.toml:\d+: "):
        load(tmp_path, 'format = 1\nname = "own"\nextends = "base.toml"\n')
    assert base.exists()


def test_parameters_keep_what_was_set_before():
    arm = oarlock.load_model("arm7", parameters={"l_ua": 0.4}).with_parameters(l_fa=0.3)
    assert (arm.parameters["l_ua"], arm.parameters["l_fa"]) == (0.4, 0.3)
    assert arm.with_parameters({"l_ha": 0.1}, l_ua=0.2).parameters == {"l_ua": 0.2, "l_fa": 0.3, "l_ha": 0.1}
    assert (
        arm.with_sensor("spare", kind="encoder", joint=arm.joint_names[0], std=0.01).parameters
        == arm.parameters
    )
    assert_refused(lambda: arm.with_parameters(l_uaa=0.2), "l_uaa")


def test_what_hangs_on_a_joint_goes_with_it():
    sculler = oarlock.load_model("sculler")
    left = sculler.without(joints=["r_elbow_flexion"])
    assert not {"r_elbow_rotation", "r_hand_flexion"} & set(left.joint_names)
    assert "r_forearm" not in left.sensor_names
    assert left.closure_names == ["l_grip"]
    q = np.zeros(len(left.coordinate_names))
    whole = sculler.forward_kinematics(np.zeros(len(sculler.coordinate_names)))
    for name, pose in zip(left.frame_names, left.forward_kinematics(q), strict=True):
        np.testing.assert_array_equal(pose, whole[sculler.frame_names.index(name)])


def test_sensors_and_closures_go_by_name():
    sculler = oarlock.load_model("sculler")
    left = sculler.without(sensors=["back"], closures=["r_grip"])
    assert left.sensor_names == [name for name in sculler.sensor_names if name != "back"]
    assert left.closure_names == ["l_grip"]
    assert left.joint_names == sculler.joint_names
    assert_refused(lambda: sculler.without(sensors=["bakc"]), "bakc")


def test_frames_joints_and_sensors_are_added():
    arm = oarlock.load_model("arm7")
    tip = arm.with_tables(
        {
            "joint": [{"name": "finger", "kind": "hinge"}],
            "frame": [
                {
                    "name": "finger",
                    "parent": arm.frame_names[-1],
                    "joint": "finger",
                    "transform": {"translation": [0.1, 0, 0]},
                }
            ],
        }
    ).with_sensor("nail", kind="imu", frame="finger", gyro_std_rad_s=0.01)
    assert (tip.joint_names[-1], tip.frame_names[-1], tip.sensor_names[-1]) == ("finger", "finger", "nail")
    moved = tip.with_frame("finger", transform={"translation": [0.2, 0, 0]})
    q = np.zeros(len(tip.coordinate_names))
    apart = moved.forward_kinematics(q)[-1, :3, 3] - tip.forward_kinematics(q)[-1, :3, 3]
    assert np.linalg.norm(apart) == pytest.approx(0.1)


def test_a_merge_changes_neither_document():
    base = {"sensor": [{"name": "a", "x": 1}], "world": {"up": [0, 1, 0]}}
    changes = {"sensor": [{"name": "a", "replace": True, "y": 2}], "world": {"up": [1, 0, 0]}}
    before = json.dumps([base, changes])
    assert merged(base, changes) == {"sensor": [{"name": "a", "y": 2}], "world": {"up": [1, 0, 0]}}
    assert json.dumps([base, changes]) == before
