"""Configurations and models: wrong keys and values are explained, and both survive pickling."""

import copy
import pickle

import numpy as np
import pytest

import oarlock
from exact_recording import load_excerpt, sculler
from refusals import assert_refused

DEFAULTS = {
    "estimate": ["gyro_bias", "accel_bias", "surge"],
    "closures": True,
    "process_noise": "jerk",
    "magnetometer": "gated",
    "filter": "ukf",
    "initial_q": None,
}


def test_defaults_are_those_that_are_promised():
    found = oarlock.Config().to_dict()
    assert {key: found[key] for key in DEFAULTS} == DEFAULTS
    assert oarlock.Config(**found) == oarlock.Config()


def test_keys_are_attributes_that_cannot_be_set():
    config = oarlock.Config(alpha=0.5, estimate=("surge",))
    assert config.alpha == 0.5
    assert config.estimate == ["surge"]
    with pytest.raises(AttributeError):
        config.alpha = 0.1
    with pytest.raises(AttributeError, match="alhpa"):
        _ = config.alhpa


@pytest.mark.parametrize("none", ["none", None, (), ""])
def test_names_stand_in_a_list_or_behind_commas(none):
    assert oarlock.Config(estimate="gyro_bias, lengths").estimate == ["gyro_bias", "lengths"]
    assert oarlock.Config(inputs="seat,r_oar_phi").inputs == ["seat", "r_oar_phi"]
    assert oarlock.Config(estimate=none).estimate == []
    track = oarlock.track(sculler(), load_excerpt().recording.slice(end_s=0.5), estimate=none)
    assert track.provenance["config"]["estimate"] == []


def test_numpy_values_are_taken():
    q = np.arange(22) / 64
    config = oarlock.Config(initial_q=q, alpha=np.float64(0.5), closures=np.bool_(False))
    assert (config.initial_q, config.alpha, config.closures) == (q.tolist(), 0.5, False)


def test_numbers_are_kept_to_the_last_bit():
    values = np.random.default_rng(0).uniform(0.1, 1.0, 200)
    assert [oarlock.Config(alpha=x).alpha for x in values] == values.tolist()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"closurs": False}, ["closurs", "closures"]),
        ({"consider": "learnt"}, ["unknown", "consider"]),
        ({"filter": "kalman"}, ["filter", "kalman", "ukf", "ekf", "factorised"]),
        ({"filter": "iekf"}, ["iekf", "removed", 'filter = "ekf"']),
        ({"process_noise": "jerky"}, ["process_noise", "jerky", "jerk", "paper"]),
        ({"magnetometer": "maybe"}, ["maybe", "off", "gated", "on"]),
        ({"alpha": 2.0}, ["alpha", "2", "(0, 1]", "0.3"]),
        ({"alpha": 0.0}, ["alpha", "0", "(0, 1]"]),
        ({"beta": 0.01}, ["beta", "0.01", "alpha^2", "0.09"]),
        ({"merge_s": -1.0}, ["merge_s", "-1", "positive"]),
        ({"output_rate_hz": -1.0}, ["output_rate_hz", "-1", "positive", "Hz"]),
        ({"learning_memory_s": 3.0}, ["unknown", "learning_memory_s"]),
        ({"belief_interval_s": 0.0}, ["belief_interval_s", "0", "positive"]),
        ({"gate_patience_s": -1.0}, ["gate_patience_s", "-1", "positive"]),
        ({"closures": 1}, ["closures", "True or False"]),
        ({"gate": "yes"}, ["gate", "True or False"]),
        ({"kappa": "x"}, ["kappa", "number"]),
        ({"estimate": 3}, ["estimate", "list", "text with commas"]),
        ({"start_window_s": float("nan")}, ["start_window_s", "nan"]),
        ({"initial_q": [float("nan")] * 22}, ["initial_q", "finite"]),
    ],
    ids=str,
)
def test_wrong_key_or_value_is_explained(keys, said):
    with pytest.raises(oarlock.DataError) as error:
        oarlock.Config(**keys)
    assert "line 1" not in str(error.value)
    assert [word for word in said if word not in str(error.value)] == [], error.value


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            {"estimate": ("gyro_bia",)},
            ["estimate", "gyro_bia", "sculler", "gyro_bias", "accel_bias", "surge"],
        ),
        ({"initial_q": [0.0, 1.0]}, ["initial_q", "2 numbers", "22", "sculler"]),
    ],
    ids=str,
)
def test_what_does_not_fit_the_model_is_explained_when_tracking(keys, said):
    recording = load_excerpt().recording.slice(end_s=0.5)
    assert_refused(lambda: oarlock.track(sculler(), recording, config=oarlock.Config(**keys)), *said)


def test_config_is_pickled_and_copied():
    config = oarlock.Config(alpha=0.5, closures=False, initial_q=[0.1] * 22)
    for twin in (pickle.loads(pickle.dumps(config)), copy.deepcopy(config)):
        assert twin == config
        assert twin != oarlock.Config()


def test_model_is_pickled_with_its_parameters():
    model = oarlock.load_model("sculler", parameters={"l_b": 0.6})
    twin = pickle.loads(pickle.dumps(model))
    assert twin.describe() == model.describe()
    assert twin.parameters["l_b"] == 0.6
    q = np.linspace(-0.5, 0.5, 22)
    assert np.array_equal(twin.forward_kinematics(q), model.forward_kinematics(q))


def test_a_pickled_model_and_config_track_alike():
    recording = load_excerpt().recording.slice(end_s=0.5)
    config = oarlock.Config(closures=False)
    twin = pickle.loads(pickle.dumps((sculler(), recording, config)))
    one, other = (
        oarlock.track(sculler(), recording, config=config),
        oarlock.track(twin[0], twin[1], config=twin[2]),
    )
    assert np.array_equal(one.q, other.q, equal_nan=True)
    assert np.array_equal(one.last_belief.covariance, other.last_belief.covariance)
