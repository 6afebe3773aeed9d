"""The field simulator: all off it is the other one, each effect touches what it should, and it stands apart."""

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

import oarlock
from exact_recording import ENCODERS, UNITS, sculler
from field_trial import DURATION_S, SEED, SILENT, changed, of_all_units, trial, with_only
from mujoco_body import MujocoBody, recorded
from oarlock.model import ModelDescription
from oarlock.rowing import FieldEffects, simulate_field
from oarlock.rowing.field.effects import GROUPS
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.rowing.simulation.motion import sculling
from refusals import assert_refused

STEP_S = 2e-3
LARGEST_WAY_M = 2.5
"""The boat's way against one that goes on at its first speed."""
# Both simulators differentiate the same splines with the same steps: they are apart by rounding, once a link and once
# in the sums. Weights of the second difference add up to 6.5, those of the first to 2.1.
ACCEL_ROUNDING_M_S2 = 16.0 * np.finfo(float).eps * LARGEST_WAY_M * 6.5 / STEP_S**2
GYRO_ROUNDING_RAD_S = 16.0 * np.finfo(float).eps * 2.1 / STEP_S
MAG_ROUNDING_UT = 1e-12 * 47.0
FIELD = Path(oarlock.__file__).parent / "rowing/field"


# --- off ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("condition", ["B-B", "S-NB"])
def test_all_off_it_is_the_other_simulator(condition):
    model = sculler()
    truth, _ = simulate_sculling(model, condition, DURATION_S, 30.0, SEED)
    bias = 0.01 if condition == "B-B" else 0.0
    motion = sculling(model, DURATION_S, 30.0, surge=condition == "B-B", seed=SEED)
    _, clean = oarlock.simulate(model, motion, noise=False, gyro_bias_rad_s=bias, accel_bias_m_s2=bias)
    field = trial(condition=condition)
    assert np.array_equal(field.truth.time_s, truth.time_s)
    np.testing.assert_allclose(field.truth.q, truth.q, rtol=0, atol=1e-13)
    tolerances = {
        "gyro_rad_s": GYRO_ROUNDING_RAD_S,
        "accel_m_s2": ACCEL_ROUNDING_M_S2,
        "mag_ut": MAG_ROUNDING_UT,
    }
    for unit in UNITS:
        for name, tolerance in tolerances.items():
            apart = np.abs(field.recording[unit].values[name] - clean[unit].values[name]).max()
            assert apart <= tolerance, (unit, name)
    for encoder in ENCODERS:
        np.testing.assert_allclose(field.recording[encoder].value, clean[encoder].value, rtol=0, atol=1e-13)
    for k, name in enumerate(field.markers.names):
        np.testing.assert_allclose(
            field.markers.position_m[:, k], truth.frame_positions(name), rtol=0, atol=1e-12
        )


def test_off_leaves_the_noise_of_the_model_file():
    noisy, clean = trial(FieldEffects.off()), trial()
    for sensor in sculler().describe().sensors:
        if sensor.kind == "imu":
            keys = (
                ("gyro_rad_s", "gyro_std_rad_s"),
                ("accel_m_s2", "accel_std_m_s2"),
                ("mag_ut", "mag_std_ut"),
            )
        else:
            keys = (("value", "std"),)
        for field, key in keys:
            noise = noisy.recording[sensor.name].values[field] - clean.recording[sensor.name].values[field]
            # 5 standard errors of a standard deviation
            own = getattr(sensor, key)
            assert noise.std() == pytest.approx(own, rel=5.0 / np.sqrt(2.0 * noise.size)), sensor.name


def test_a_hull_that_rocks_is_felt_as_mujoco_feels_it():
    """Pitch, roll, yaw and heave act on every gyroscope, accelerometer and magnetometer."""
    effects = replace(SILENT, hull_pitch_rad=0.02, hull_roll_rad=0.09, hull_yaw_rad=0.09, hull_heave_m=0.02)
    field, model = trial(effects), sculler()
    up, forward = np.eye(3)[1], np.eye(3)[2]
    body = MujocoBody(model.describe(), (up, np.cross(up, forward), forward))
    truth, time_s = field.truth, field.truth.time_s
    angles = field.hull_angles_rad[:, [2, 0, 1]]
    # What lies 0.2 m below the root and 0.3 m toward the stern stays where it is, but for heave and surge.
    still = 0.3 * forward - 0.2 * up
    place = still - Rotation.from_euler("YXZ", angles).apply(still) + field.hull_heave_m[:, None] * up
    course, turns = (make_interp_spline(time_s, x, k=5) for x in (place, angles))
    rows = np.arange(30, len(truth.time_s) - 30, 7)
    expected = []
    for r in rows:
        base = np.append(course(time_s[r], 2)[:2], field.surge_m_s2[r])
        rocking = np.stack([turns(time_s[r], order) for order in range(3)])
        expected.append(body.readings(truth.q[r], truth.qd[r], truth.qdd[r], base, rocking))
    apart = np.abs(recorded(field.recording, list(UNITS))[rows] - np.stack(expected)).max(axis=(0, 1, 3))
    print(f"on a rocking hull apart by {apart[0]:.1e} rad/s, {apart[1]:.1e} m/s2, {apart[2]:.1e} uT")
    # Here rates of the hull come from its angles every 8 ms, by quintic splines: good to a few 1e-7 of what is felt.
    assert apart[0] < 1e-8
    assert apart[1] < 1e-5
    assert apart[2] < 1e-10
    apart_from_still = np.abs(
        recorded(field.recording, list(UNITS)) - recorded(trial().recording, list(UNITS))
    ).max(axis=(0, 1, 3))
    assert (apart_from_still > [0.1, 0.5, 3.0]).all()


def on_a_hull(model: oarlock.Model) -> oarlock.Model:
    """The sculler on five joints between a root that does not turn and the boat."""
    moved = {"sway": ("slide", "x"), "heave": ("slide", "y"), "yaw": ("hinge", "y"), "pitch": ("hinge", "x")}
    text, parent = model.text.replace('parent = "root"', 'parent = "hull"'), "root"
    for name, (kind, axis) in (moved | {"roll": ("hinge", "z")}).items():
        frame = "hull" if name == "roll" else f"hull_{name}"
        text += f'\n[[joint]]\nname = "hull_{name}"\nkind = "{kind}"\n'
        text += f'[[frame]]\nname = "{frame}"\nparent = "{parent}"\n'
        text += f'transform = {{ translation = [0, 0, 0] }}\naxis = "{axis}"\njoint = "hull_{name}"\n'
        parent = frame
    unit = '[[sensor]]\nname = "keel"\nkind = "imu"\nframe = "hull"\ngyro_std_rad_s = 0.01\naccel_std_m_s2 = 0.01\n'
    return oarlock.Model.from_toml(text + unit, "on_a_hull.toml", {})


def test_a_model_with_hull_joints_gets_the_same_motion_in_them():
    effects = replace(SILENT, hull_pitch_rad=0.01, hull_roll_rad=0.05, hull_yaw_rad=0.02, hull_heave_m=0.01)
    plain, model = trial(effects), on_a_hull(sculler())
    jointed = simulate_field(
        model, effects, condition="B-NB", duration_s=DURATION_S, rate_spm=30.0, seed=SEED
    )
    for unit in UNITS:
        for name, values in plain.recording[unit].values.items():
            tolerance = ACCEL_ROUNDING_M_S2 if name == "accel_m_s2" else 1e-9
            np.testing.assert_allclose(jointed.recording[unit].values[name], values, rtol=0, atol=tolerance)
    np.testing.assert_allclose(jointed.markers.position_m, plain.markers.position_m, rtol=0, atol=1e-12)
    angles = np.stack([jointed.truth[f"hull_{name}"].angle_rad for name in ("pitch", "roll", "yaw")], axis=1)
    np.testing.assert_allclose(angles, plain.hull_angles_rad, rtol=0, atol=1e-12)
    wrist = jointed.truth.frame_positions("r_wrist", relative_to="hull")
    np.testing.assert_allclose(wrist, jointed.markers.position_m[:, 2], rtol=0, atol=1e-9)
    loose = replace(effects, wobble_rad=0.1, skin_wander_rad=0.1)
    keel = simulate_field(model, loose, condition="B-NB", duration_s=DURATION_S, rate_spm=30.0, seed=SEED)
    # no soft tissue on wood
    assert np.array_equal(keel.recording["keel"].gyro_rad_s, jointed.recording["keel"].gyro_rad_s)


# --- one at a time --------------------------------------------------------------------------------------

SIGNALS = of_all_units("gyro_rad_s", "accel_m_s2", "mag_ut")
ARMS = {s for s in SIGNALS if not s.startswith("back")}
ACCEL, GYRO, MAG = (of_all_units(field) for field in ("accel_m_s2", "gyro_rad_s", "mag_ut"))
SEAT, OARS = {"seat.value"}, {f"{name}.value" for name in ENCODERS if name != "seat"}
GROUPED = (
    (ARMS, ("skin_twist",)),
    (SIGNALS, ("skin_tilt_rad", "skin_wander_rad", "wobble_rad", "mount_error_rad")),
    (SIGNALS, ("hull_pitch_rad", "hull_roll_rad", "hull_yaw_rad")),
    (SIGNALS | {"truth"}, ("spine_bend_rad", "trunk_twist_rad", "length_error")),
    (ARMS | {"truth"}, ("shoulder_protraction_m", "shoulder_elevation_m")),
    (ARMS | {"truth"}, ("grip_slip_m", "grip_turn_rad", "rig_error_m")),
    (OARS, ("oar_offset_rad", "oar_scale")),
    (SEAT, ("seat_offset_m", "seat_scale")),
    (ACCEL, ("skin_shift_m", "wobble_m", "hull_heave_m", "mount_offset_m")),
    (ACCEL, ("accel_bias_m_s2", "accel_drift_m_s2", "accel_scale")),
    (GYRO, ("gyro_bias_rad_s", "gyro_drift_rad_s", "gyro_scale")),
    (MAG, ("hard_iron_ut", "soft_iron", "rail_iron_ut")),
    (of_all_units("time_s"), ("clock_jitter_s",)),
)
TOUCHES = {name: touched for touched, names in GROUPED for name in names}
# Surge is the answer of the boat to the body: what moves the body otherwise moves every accelerometer a little.
MOVES_THE_BOAT = {name for name, touched in TOUCHES.items() if "truth" in touched}


@pytest.mark.parametrize("name", TOUCHES)
def test_an_effect_alone_changes_what_it_should_and_nothing_else(name):
    found = changed(trial(replace(SILENT, **{name: getattr(FieldEffects.wild(), name) or 0.01})), trial())
    allowed = TOUCHES[name] | (of_all_units("accel_m_s2") if name in MOVES_THE_BOAT else set())
    if "truth" in allowed:
        allowed = allowed | SIGNALS | {"seat.value"}  # the stretcher is set anew
    assert found <= allowed
    assert TOUCHES[name] <= found | ({"back.gyro_rad_s", "back.mag_ut"} if name == "length_error" else set())


def test_every_effect_has_a_group_and_a_test():
    effects = set(FieldEffects().strengths())
    assert {name for names in GROUPS.values() for name in names} == effects
    elsewhere = {"clock_offset_s", "clock_drift", "packet_loss", "gap_s", "noise_factor"}
    elsewhere |= {"gyro_range_rad_s", "accel_range_m_s2"}
    assert set(TOUCHES) | elsewhere == effects


# --- seeds, presets, errors -----------------------------------------------------------------------------


def test_same_seed_same_bits_and_another_is_another():
    asked = {"duration_s": 2.0, "rate_spm": 30.0}
    one, again = (simulate_field(sculler(), seed=3, **asked) for _ in range(2))
    other = simulate_field(sculler(), seed=4, **asked)
    for a, b, c in zip(one.recording, again.recording, other.recording, strict=True):
        assert np.array_equal(a.time_s, b.time_s)
        for name, values in a.values.items():
            assert np.array_equal(values, b.values[name], equal_nan=True)
            assert values.shape != c.values[name].shape or not np.array_equal(values, c.values[name])
    assert np.array_equal(one.markers.position_m, again.markers.position_m)
    assert np.array_equal(one.truth.q, again.truth.q)


def test_an_effect_draws_the_same_whatever_else_is_on():
    alone, together = (
        with_only(mount_error_rad=0.07),
        trial(replace(FieldEffects.wild(), mount_error_rad=0.07, mount_offset_m=0.0)),
    )
    for unit in UNITS:
        np.testing.assert_allclose(
            alone.units[unit].link_from_sensor, together.units[unit].link_from_sensor, atol=1e-15
        )


def test_strength_scales_from_off_to_the_effects():
    wild = FieldEffects.wild()
    assert wild.scaled(0.0) == FieldEffects.off()
    assert wild.scaled(1.0) == wild
    half = wild.scaled(0.5)
    assert half.mount_error_rad == pytest.approx(0.5 * wild.mount_error_rad)
    assert half.noise_factor == pytest.approx(2.0)
    assert half.gyro_range_rad_s == pytest.approx(2.0 * wild.gyro_range_rad_s)
    assert wild.only("mounts") == replace(
        FieldEffects.off(), mount_error_rad=wild.mount_error_rad, mount_offset_m=wild.mount_offset_m
    )
    assert wild.only(*GROUPS) == wild
    assert FieldEffects.misfit() == FieldEffects.misfit().only("mounts", "lengths", "hull")


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        ({"packet_loss": 1.0}, "packet_loss is 1.0; give a number from 0 to 0.9"),
        ({"mount_error_rad": -0.1}, "mount_error_rad is -0.1"),
        ({"noise_factor": float("nan")}, "noise_factor is nan"),
        ({"gyro_range_rad_s": 0.0}, "inf switches it off"),
    ],
)
def test_effects_out_of_range_are_refused(bad, told):
    with pytest.raises(oarlock.DataError, match=told):
        FieldEffects(**bad)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="no condition 'B'"):
        simulate_field(sculler(), condition="B")
    assert_refused(lambda: simulate_field(oarlock.load_model("arm7")), "no frame seat")
    assert_refused(lambda: simulate_field(sculler(), rate_hz=0.0), "rate_hz is 0")
    assert_refused(lambda: FieldEffects().only("mount"), "no effect or group 'mount'")
    with pytest.raises(oarlock.DataError, match=r"beyond the stretched arm|no posture holds"):
        simulate_field(sculler(), replace(SILENT, rig_error_m=0.5), duration_s=3.0)


def test_the_rate_is_that_of_all_sensors():
    field = trial(rate_hz=100.0)
    assert {round(s.rate_hz) for s in field.recording} == {100}
    assert len(field.recording["back"]) == len(field.truth.time_s)


# --- independence ---------------------------------------------------------------------------------------

KINEMATICS = {"forward_kinematics", "predict_measurements", "imu_signals"}
ENGINES_OWN = KINEMATICS | {"simulate", "track", "smooth", "Tracker"}
STORAGE = {"oarlock.storage.arrays", "oarlock.storage.errors", "oarlock.storage.folder_writer"}
ROOMS = ("oarlock", "oarlock.markers", "oarlock.model", "oarlock.recording")
ALLOWED = {"Calibration", "ImuStream", "Markers", "Model", "Recording", "ScalarStream", "Track"}


def test_it_knows_nothing_of_filter_or_engine():
    """No numerics but its own: not the engine's kinematics, not its simulator, not its readings."""
    files = sorted(FIELD.glob("*.py"))
    assert len(files) > 5
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "oarlock":
                # A description is plain data.
                names = {a.name for a in node.names if not a.name.endswith("Description")}
                fine = node.module in STORAGE or node.module.startswith("oarlock.rowing")
                assert fine or (node.module in ROOMS and names <= ALLOWED), (
                    f"{path.name}: {node.module} {names}"
                )
                assert not node.module.endswith((".experiment", ".motion")), path.name
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                assert node.func.attr not in ENGINES_OWN, (path.name, node.func.attr)


class OnlyDescribed:
    """A model that can do nothing but describe itself."""

    name, text, path = "sculler", "", ""

    def __init__(self) -> None:
        self.parameters = sculler().parameters
        self._described = sculler().describe()

    def describe(self) -> ModelDescription:
        return self._described


def test_a_description_is_all_it_reads():
    effects = replace(FieldEffects(), length_error=0.0, rig_error_m=0.0)
    asked = {"duration_s": 2.0, "rate_spm": 30.0, "seed": 1}
    described: Any = OnlyDescribed()
    one, other = (simulate_field(m, effects, **asked) for m in (described, sculler()))
    for a, b in zip(one.recording, other.recording, strict=True):
        assert all(np.array_equal(v, b.values[k], equal_nan=True) for k, v in a.values.items())


# --- tracked --------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_default_filter_follows_a_bad_day():
    """Bounds above what is measured (docs/field-simulator.md): a filter that is lost is off by tens of degrees.

    In its first seconds the default does not know yet that these units do not move on skin: 0.25 deg.
    """
    eleven = [n for n in sculler().joint_names if "oar" not in n and "hand" not in n and n != "seat"]
    for effects, bound_deg in ((FieldEffects.wild(), 20.0), (FieldEffects.off(), 0.5)):
        field = trial(effects, condition="B-B", duration_s=8.0)
        scores = oarlock.evaluate(oarlock.track(sculler(), field.recording), field.truth, start_s=2.0)
        assert scores.mean_rmse_deg(eleven) < bound_deg
