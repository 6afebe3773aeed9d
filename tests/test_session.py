"""A guided session: what is found, what is said, and what is asked for again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import DataError, Recording
from oarlock.calibration import SessionPlan, SessionStep
from oarlock.calibration.robust_fit import huber, robust_fit
from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.encoders import encoder_scales
from oarlock.recording import Clock, ImuStream, ScalarStream
from oarlock.simulation import SessionErrors
from refusals import assert_refused

# What users are promised, for a person who takes up postures to about a degree.
MOUNT_RAD = np.radians(3.0)
GYRO_RAD_S = 0.001
# Noise of a minute's rest in several attitudes; what is left of 15 uT and of 3 %.
ACCEL_M_S2 = 0.05
OFFSET_UT = 0.6
MATRIX = 0.02
# Movements end where the body is still; the course itself holds still for a second of nine.
OVERLAP = 0.8


@pytest.fixture(scope="module")
def model():
    return oarlock.load_model("arm7")


@pytest.fixture(scope="module")
def trial(model):
    return oarlock.simulation.simulate_session(
        model, errors=SessionErrors(clock_offset_s=0.1, clock_drift=3e-5), seed=31
    )


@pytest.fixture(scope="module")
def found(model, trial):
    known = oarlock.Calibration(clocks=trial.calibration.clocks, parameters={"l_ua": 0.3})
    return oarlock.calibration.calibrate_session(model, trial.recording, calibration=known)


def off_rad(found, true, unit):
    turn = found.mounts[unit][0] @ true.mounts[unit][0].T
    return Rotation.from_matrix(turn).magnitude()


def checks(found, **wanted):
    told = found.noted["session"]["check"]
    return [c for c in told if all(c[k] == v for k, v in wanted.items())]


def test_everything_is_found(found, trial):
    true = trial.calibration
    for unit in true.mounts:
        assert off_rad(found, true, unit) < MOUNT_RAD
        assert np.abs(found.gyro_biases_rad_s[unit] - true.gyro_biases_rad_s[unit]).max() < GYRO_RAD_S
        assert np.abs(found.accel_biases_m_s2[unit] - true.accel_biases_m_s2[unit]).max() < ACCEL_M_S2
        assert np.abs(found.mag_offsets_ut[unit] - true.mag_offsets_ut[unit]).max() < OFFSET_UT
        assert np.abs(found.mag_matrices[unit] - true.mag_matrices[unit]).max() < MATRIX
        assert (found.mount_stds_rad[unit] > 0.0).all()
        assert (found.gyro_bias_stds_rad_s[unit] < GYRO_RAD_S).all()
    assert found.noted["session"]["passed"]


def test_what_was_known_is_carried_on(found, trial):
    assert dict(found.parameters) == {"l_ua": 0.3}
    assert dict(found.clocks) == dict(trial.calibration.clocks)


def test_steps_are_found_where_they_were(found, trial):
    for step in found.noted["session"]["step"]:
        if step["name"] in trial.spans:
            start, end = trial.spans[step["name"]]
            overlap = min(end, step["end_s"]) - max(start, step["start_s"])
            assert overlap > OVERLAP * (end - start), step["name"]


def test_the_result_is_a_file_and_a_track(found, model, trial, tmp_path):
    found.save(tmp_path / "cal.toml")
    again = oarlock.load_calibration(tmp_path / "cal.toml")
    assert again.noted["session"]["plan"] == "arm, two minutes"
    start, end = trial.spans["elbow flexion"]
    track = oarlock.track(model, trial.recording.slice(start, end), again)
    # A single posture error of a degree in each joint, and mounts that are right to the promise.
    joint = trial.truth["elbow_flexion"]
    true = np.interp(track.time_s, trial.truth.time_s, joint.angle_rad)
    swing = track.time_s > start + 2.0
    assert np.sqrt(np.mean((track["elbow_flexion"].angle_rad - true)[swing] ** 2)) < 2.0 * MOUNT_RAD
    assert any("soft iron" in note for note in track.notes)


def cut(trial, end_s):
    return trial.recording.slice(-np.inf, end_s)


def test_a_missing_step_is_to_be_done_again(model, trial):
    found = oarlock.calibration.calibrate_session(model, cut(trial, trial.spans["T-pose"][0] - 1.0))
    assert not found.noted["session"]["passed"]
    again = checks(found, outcome="redo")
    assert {c["step"] for c in again} >= {"T-pose", "N-pose again"} or {c["what"] for c in again} >= {"pose"}


def changed(trial, unit, change):
    """The recording with one unit's stream changed: change(stream) -> dict of fields."""
    streams = [
        ImuStream(s.name, s.time_s, **(dict(s.values) | change(s))) if s.name == unit else s
        for s in trial.recording
    ]
    return Recording(streams, trial.recording.meta)


def test_a_unit_worn_upside_down_is_found(model, trial):
    half = np.diag([1.0, -1.0, -1.0])
    turned = changed(trial, "forearm", lambda s: {n: v @ half.T for n, v in s.values.items()})
    found = oarlock.calibration.calibrate_session(model, turned)
    true = trial.calibration.mounts["forearm"][0] @ half.T
    assert Rotation.from_matrix(found.mounts["forearm"][0] @ true.T).magnitude() < MOUNT_RAD


def test_a_unit_that_slips_is_seen(model, trial):
    turn = Rotation.from_euler("z", 40.0, degrees=True)

    def slip(stream):
        late = stream.time_s > trial.spans["forearm rotation"][1] + 1.0
        return {n: np.where(late[:, None], turn.apply(np.array(v)), v) for n, v in stream.values.items()}

    found = oarlock.calibration.calibrate_session(model, changed(trial, "hand", slip))
    assert not found.noted["session"]["passed"]
    assert any("hand" in c["subject"] + c["sentence"] for c in checks(found, outcome="redo"))


def test_without_a_table_what_postures_do_not_tell_is_kept(model, trial):
    plan = oarlock.calibration.default_plan(model)
    worn = SessionPlan("worn only", tuple(s for s in plan.steps if s.kind != "turn"))
    start = trial.spans["N-pose"][0]
    found = oarlock.calibration.calibrate_session(model, trial.recording.slice(start - 1.0, np.inf), worn)
    assert "hand" not in found.accel_biases_m_s2
    kept = checks(found, what="accelerometer", subject="hand")
    assert [c["outcome"] for c in kept] == ["kept"]
    assert "attitudes" in kept[0]["sentence"]


def test_a_silent_unit_and_a_recording_of_another_time_are_refused(model, trial):
    silent = changed(trial, "hand", lambda s: {"gyro_rad_s": np.full_like(s.gyro_rad_s, np.nan)})
    with pytest.raises(DataError, match='"hand" has 0 complete readings'):
        oarlock.calibration.calibrate_session(model, silent)
    late = SessionPlan("late", (SessionStep("N-pose", "pose", 1000.0, 1004.0),))
    with pytest.raises(DataError, match=r'"N-pose": lasts from 1000.00 .* recording from'):
        oarlock.calibration.calibrate_session(model, trial.recording, late)


def test_a_body_without_magnetometers_and_with_ball_joints():
    body = oarlock.load_model("qmt_full_body")
    trial = oarlock.simulation.simulate_session(body, errors=SessionErrors(posture_rad=0.0), seed=32)
    found = oarlock.calibration.calibrate_session(body, trial.recording)
    for unit in trial.calibration.mounts:
        assert off_rad(found, trial.calibration, unit) < MOUNT_RAD, unit
    assert not found.mag_matrices


# --- plans --------------------------------------------------------------------------------------------


def test_a_plan_is_a_file(tmp_path):
    for name in ("arm7", "sculler", "qmt_full_body"):
        plan = oarlock.calibration.default_plan(oarlock.load_model(name))
        plan.save(tmp_path / "plan.toml")
        assert oarlock.calibration.load_session_plan(tmp_path / "plan.toml") == plan
        assert all(step.say for step in plan.steps)


def test_a_model_without_a_plan_of_its_own_gets_one():
    body = oarlock.load_model("pendulum3")
    plan = oarlock.calibration.default_plan(body)
    plan.check(body)
    assert [s.kind for s in plan.steps] == ["pose", "move", "pose", "move", "pose", "move", "pose"]


@pytest.mark.parametrize(
    ("step", "words"),
    [
        ({"kind": "poes"}, ["kind", "'poes'", '"pose"']),
        ({"kind": "pose", "start_s": 1.0}, ["both start_s and end_s"]),
        ({"kind": "pose", "start_s": 2.0, "end_s": 1.0}, ["from 2.0 to 1.0 s", "later"]),
        ({"kind": "move"}, ["needs joints"]),
        ({"kind": "mark", "stream": "seat"}, ["start_s and end_s", "nothing in the data"]),
        ({"kind": "sign", "stream": "seat"}, ["needs other"]),
        ({"kind": "move", "joints": ("x",), "first": 2}, ["first = 2", "1 or -1"]),
    ],
)
def test_steps_that_make_no_sense(step, words):
    assert_refused(lambda: SessionStep("step", **step), *words)


def test_a_wrong_plan_names_file_line_and_the_nearest_name(model, tmp_path):
    file = tmp_path / "plan.toml"
    file.write_text('format = 1\n[[step]]\nname = "a"\nkind = "pose"\nposee = {}\n')
    with pytest.raises(DataError, match=r'plan.toml:5, key "posee".*"pose"'):
        oarlock.calibration.load_session_plan(file)
    for values in (
        {"joints": ("elbow_flexon",)},
        {"joints": ("elbow_flexion",), "pose": {"elbow_flexon": 1.0}},
    ):
        with pytest.raises(DataError, match='"elbow_flexion"'):
            SessionPlan("p", (SessionStep("a", "move", **values),)).check(model)


# --- encoders -----------------------------------------------------------------------------------------


def scalars(scale, zero, seed=0):
    """A seat and an oar's angle that falls as the seat goes forward, both read with errors."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, 30.0, 0.01)
    course = np.where(time_s < 20.0, 0.3 * np.sin(2.0 * time_s), 0.0)
    reading = course / scale + zero + rng.normal(0.0, 1e-4, len(time_s))
    return Recording(
        [
            ScalarStream("slide", time_s, -0.5 * course + 0.4, "m"),
            ScalarStream("angle", time_s, reading, "rad"),
        ]
    )


ZERO = SessionStep("square", "mark", 21.0, 23.0, stream="angle", value=0.0)
AGAINST = SessionStep("sign", "sign", stream="angle", other="slide", sign=-1)


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_zero_by_a_mark_and_sign_by_another_stream(scale):
    found, told = encoder_scales((ZERO, AGAINST), {"square": (21.0, 23.0)}, scalars(scale, 0.2))
    assert found["angle"].scale == scale
    assert found["angle"].zero == pytest.approx(0.2, abs=1e-4)
    assert {c.outcome for c in told} == {"pass"}


def test_two_marks_give_the_scale_and_a_wrong_one_is_seen():
    rec = scalars(1.0, 0.1)
    crest = np.pi / 4
    marks = [ZERO, SessionStep("crest", "mark", crest - 0.02, crest + 0.02, stream="angle", value=0.3)]
    found, told = encoder_scales(marks, {}, rec)
    assert found["angle"].scale == pytest.approx(1.0, abs=0.01)
    assert told[0].outcome == "pass"
    wrong = [ZERO, replace(marks[1], value=0.4)]
    assert encoder_scales(wrong, {}, rec)[1][0].outcome == "redo"


def test_streams_that_do_not_move_tell_no_sign():
    rec = scalars(1.0, 0.0)
    still = SessionStep("sign", "sign", 21.0, 29.0, stream="angle", other="slide", sign=-1)
    found, told = encoder_scales((still,), {"sign": (21.0, 29.0)}, rec)
    assert not found
    assert told[0].outcome == "redo"


def test_a_clock_is_applied_before_the_steps_are_sought(model, trial):
    far = {name: Clock(clock.offset_s + 500.0) for name, clock in trial.calibration.clocks.items()}
    streams = [replace(s, time_s=s.time_s + 500.0) for s in trial.recording]
    found = oarlock.calibration.calibrate_session(
        model, Recording(streams), calibration=oarlock.Calibration(clocks=far)
    )
    step = next(s for s in found.noted["session"]["step"] if s["name"] == "T-pose")
    assert abs(step["start_s"] - trial.spans["T-pose"][0]) < 1.0


@pytest.mark.parametrize("name", ["sculler", "qmt_full_body"])
def test_slopes_of_an_axis_are_its_derivatives(name):
    model = oarlock.load_model(name)
    body = BodyKinematics.of(model, [s.name for s in model.describe().inertial_units])
    q = np.random.default_rng(3).normal(0.0, 0.5, len(model.coordinate_names))
    pairs = [(joint, child) for joint in body.joints for child in body.below(joint)]
    assert pairs
    for joint, child in pairs:
        about = None if len(body.joints[joint]) == 1 else np.array([0.6, 0.8, 0.0])
        slopes = body.axis_in_link(joint, about, child, q)[1]
        for k, step in enumerate(1e-4 * np.eye(len(q))):
            ahead, behind = (body.axis_in_link(joint, about, child, q + s)[0] for s in (step, -step))
            # the difference is off by its step squared, 1e-8
            assert slopes[k] == pytest.approx((ahead - behind) / 2e-4, abs=1e-8), (joint, child, k)


def test_a_robust_fit_gives_outliers_less_weight_and_keeps_what_nothing_determines():
    readings = np.array([1.0, 1.1, 0.9, 1.0, 50.0])

    def linearised(p):
        return p[0] - readings, np.tile([1.0, 0.0], (5, 1))

    found, covariance = robust_fit(linearised, np.array([9.0, 7.0]), huber(3.0), damping=1e-9)
    # the outlier pulls as a residual of 3 does: 4 p - 4 = 3
    assert found == pytest.approx([1.75, 7.0], abs=1e-6)
    assert covariance[1, 1] == pytest.approx(1e9)
