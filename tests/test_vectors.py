"""The shipped scullers agree with reference vectors of an independent implementation, through the public API."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oarlock
from exact_recording import oars_as_states
from oarlock.storage.arrays import Floats
from oarlock.storage.toml import toml_text

VECTORS = Path(__file__).parent / "vectors"
POSE = 1e-12  # a product of 25 matrices of numbers near 1: a few hundred roundings
SIGNAL = 1e-9  # signals reach 1e3 m/s2 and 1e2 rad/s; the vectors promise no more
CLOSED = 1e-9  # what the closed postures of the vectors promise
WALKING = ("r_hand_abduction", "r_hand_flexion", "l_hand_abduction", "l_hand_flexion")
OARS = ("r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha")
IMUS = {
    "Back": "back",
    "R Upperarm": "r_upperarm",
    "R Forearm": "r_forearm",
    "L Upperarm": "l_upperarm",
    "L Forearm": "l_forearm",
}


def vectors(name: str) -> dict[str, Any]:
    return json.loads((VECTORS / f"{name}.json").read_text(encoding="utf-8"))


def parameters(given: dict[str, Any]) -> dict[str, float]:
    """The vectors' parameters under the model's names: `l_cl_R` -> `l_cl_r`, `r_0_18` -> `r_pin_x` and so on."""
    values = {name.lower(): value for name, value in given.items() if not isinstance(value, list)}
    for side, key in (("r", "r_0_18"), ("l", "r_0_22")):
        values |= {f"{side}_pin_{axis}": x for axis, x in zip("xyz", given[key], strict=True)}
    return values


def imu_table(sensor: dict[str, Any], name: str, frame_names: list[str]) -> dict[str, Any]:
    return {
        "name": name,
        "kind": "imu",
        "frame": frame_names[sensor["frame"]],
        "gyro_std_rad_s": 0.01,
        "accel_std_m_s2": 0.01,
        "mag_std_ut": 1.0,
        "mount": {"rotation": sensor["R_link_from_sensor"], "offset": sensor["offset_in_link"]},
    }


def model_with_sensors(sensors: list[dict[str, Any]], given: dict[str, Any], folder: Path) -> oarlock.Model:
    """The shipped sculler with these inertial units and no other sensor, written as a file and read from it."""
    shipped = oarlock.load_model("sculler")
    table = tomllib.loads(shipped.text)
    names = list(shipped.frame_names)
    table["sensor"] = [imu_table(s, f"unit_{i}", names) for i, s in enumerate(sensors)]
    file = folder / "eleven_units.toml"
    file.write_text(toml_text(table), encoding="utf-8")
    return oarlock.load_model(file, parameters=parameters(given))


def grip_rows(z: Floats, model: oarlock.Model) -> Floats:
    """Rows of both closures, (..., 12): right points and axes, then left."""
    first = list(model.measurement_names).index("r_grip.x")
    return z[..., first : first + 12]


@pytest.mark.parametrize(("file", "name"), [("fk", "sculler"), ("fk_table2_as_printed", "sculler_table2")])
def test_forward_kinematics(file, name):
    given = vectors(file)
    model = oarlock.load_model(name, parameters=parameters(given["params"]))
    q, expected = np.array(given["q"]), np.array(given["T_frames_1_to_25"])
    poses = model.forward_kinematics(q)
    assert poses.shape == (len(q), 26, 4, 4)
    assert np.array_equal(poses[:, 0], np.broadcast_to(np.eye(4), (len(q), 4, 4)))
    np.testing.assert_allclose(poses[:, 1:], expected, rtol=0, atol=POSE)


def test_table_as_printed_is_another_body():
    """Otherwise the test above could compare one model twice."""
    q = np.array(vectors("fk")["q"])
    corrected, printed = (oarlock.load_model(n).forward_kinematics(q) for n in ("sculler", "sculler_table2"))
    assert np.abs(corrected - printed).max() > 0.1


def test_poses_of_one_posture_and_of_many_agree():
    model, q = oarlock.load_model("sculler"), np.array(vectors("fk")["q"])
    alone = np.stack([model.forward_kinematics(row) for row in q])
    assert np.array_equal(alone, model.forward_kinematics(q))
    assert np.array_equal(alone.reshape(2, 5, 26, 4, 4), model.forward_kinematics(q.reshape(2, 5, 22)))


@pytest.mark.parametrize("rests", [False, True])
def test_inertial_signals(rests, tmp_path):
    """A root at rest needs no base."""
    given = vectors("imu")
    model = model_with_sensors(given["sensors"], given["params"], tmp_path)
    names = ("base_R_world_from_root", "base_omega", "base_omegadot", "base_acc")
    base = None if rests else oarlock.model.Base(*(np.array(given[name]) for name in names))
    rows = slice(0, 5) if rests else slice(None)
    assert np.any(np.array(given["base_acc"])[rows]) != rests
    z = model.predict_measurements(*(np.array(given[key])[rows] for key in ("q", "qd", "qdd")), base)
    expected = np.array(given["out_gyro_acc_mag"])[rows].reshape(len(z), -1)
    np.testing.assert_allclose(z[:, : 9 * len(given["sensors"])], expected, rtol=0, atol=SIGNAL)


def test_closure_residuals():
    given = vectors("closure")
    model = oarlock.load_model("sculler", parameters=parameters(given["params"]))
    q = np.array(given["q"])
    still = np.zeros_like(q)
    found = grip_rows(model.predict_measurements(q, still, still), model)
    np.testing.assert_allclose(found, np.array(given["residual_rp_rz_lp_lz"]), rtol=0, atol=POSE)
    assert np.abs(found[-5:]).max() < CLOSED
    assert np.abs(found[:-5]).max() > 0.1


def joint_values(given: dict[str, Any], model: oarlock.Model) -> tuple[Floats, ...]:
    """(q, qd, qdd) in the model's order from the vectors' states and encoder readings."""
    names = list(model.joint_names)
    x = np.array(given["x"])
    moving = [n for n in names if n not in WALKING and "oar" not in n]
    values = np.zeros((3, len(x), len(names)))
    for i, name in enumerate(moving):
        values[:, :, names.index(name)] = x[:, 3 * i : 3 * i + 3].T
    for i, name in enumerate(WALKING):
        values[0, :, names.index(name)] = x[:, 36 + i]
    for i, name in enumerate(OARS):
        values[0, :, names.index(name)] = np.array(given["enc_phiR_alphaR_phiL_alphaL"])[:, i]
    return tuple(values)


def test_whole_measurement_of_the_filter():
    given = vectors("filter_blocks")
    model = oarlock.load_model("sculler", parameters=parameters(given["params"]))
    described = {s.name: s for s in model.describe().sensors}
    for sensor in given["sensors"]:
        own = described[IMUS[sensor["name"]]]
        assert own.frame == model.frame_names[sensor["frame"]]
        np.testing.assert_allclose(own.mount.rotation, sensor["R_link_from_sensor"], rtol=0, atol=POSE)
        np.testing.assert_allclose(own.mount.offset, sensor["offset_in_link"], rtol=0, atol=POSE)
    z = model.predict_measurements(*joint_values(given, model))
    np.testing.assert_allclose(z, np.array(given["h"]), rtol=0, atol=SIGNAL)


def test_oars_as_states_measure_the_same(tmp_path):
    """Without `input = true` the encoders get rows of their own; everything else stays."""
    given = vectors("filter_blocks")
    shipped, model = oarlock.load_model("sculler"), oars_as_states(tmp_path)
    values = joint_values(given, model)
    z, names = model.predict_measurements(*values), list(model.measurement_names)
    kept = [names.index(n) for n in shipped.measurement_names]
    np.testing.assert_allclose(z[:, kept], np.array(given["h"]), rtol=0, atol=SIGNAL)
    encoders = [names.index(n) for n in OARS]
    assert np.array_equal(z[:, encoders], np.array(given["enc_phiR_alphaR_phiL_alphaL"]))
