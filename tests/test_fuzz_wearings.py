"""What is told beside the readings, with wounds: session plans, whole calibrations, counters and clocks, odd meta."""

import json

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import oarlock
from fuzz_campaign import answered, campaign
from fuzz_wounds import wounded, wounds
from oarlock.formats.csv import read_csv
from oarlock.model.shipped_files import model_folder
from oarlock.recording.packets import lost_packets
from oarlock.recording.plausibility import plausibility
from test_fuzz_arrays import SCALARS

MODEL = oarlock.load_model("pendulum3")
ARM = oarlock.load_model("arm7")
ROWS = 40
TIME_S = np.arange(ROWS) / 50.0


def example():
    up = np.tile([0.0, 9.8, 0.1], (ROWS, 1))
    units = [
        oarlock.recording.ImuStream(name, TIME_S, gyro_rad_s=0.0 * up, accel_m_s2=up, mag_ut=4.0 * up)
        for name in "ab"
    ]
    return oarlock.Recording([*units, oarlock.recording.ScalarStream("seat", TIME_S, np.sin(TIME_S), "m")])


RECORDING = example()


def put(file, text):
    file.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")


# --- session plans ----------------------------------------------------------------------------------------

PLANS = {
    name: (model_folder() / "plans" / f"{name}.toml").read_text(encoding="utf-8")
    for name in ("arm7", "sculler")
}
PLANS["all kinds"] = """format = 1
name = "all kinds"
[[step]]
name = "rest"
kind = "still"
start_s = 0.0
end_s = 2.5
[[step]]
name = "swing"
kind = "move"
joints = ["shoulder_flexion"]
axis = [0, 0, 1]
first = -1
[[step]]
name = "square"
kind = "mark"
start_s = 3
end_s = 4.0
stream = "seat"
value = 0.1
posture_std_rad = 0.1
[[step]]
name = "against"
kind = "sign"
stream = "seat"
other = "oar"
sign = -1
"""


def check_plan(text, folder):
    file = folder / "plan.toml"
    put(file, text)
    plan = answered(lambda: oarlock.calibration.load_session_plan(file))
    if plan is None:
        return
    answered(lambda: plan.check(ARM))
    repr(plan)
    plan.save(file)
    assert oarlock.calibration.load_session_plan(file) == plan


def test_session_plans(tmp_path):
    campaign(
        lambda name, harm: check_plan(wounded(PLANS[name], harm), tmp_path),
        st.sampled_from(sorted(PLANS)),
        wounds,
    )


@st.composite
def anything(draw):
    """As a function, whose name is short: the strategy as a text fills pages."""
    names = st.text(max_size=3) | SCALARS.filter(lambda name: type(name).__hash__ is not None)
    arrays = hnp.arrays(np.float64, hnp.array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=3))
    return draw(
        SCALARS | arrays | st.lists(SCALARS, max_size=3) | st.dictionaries(names, SCALARS, max_size=2)
    )


VALUES = anything()
STEPS = st.fixed_dictionaries(
    {
        "name": st.text(max_size=4) | SCALARS,
        "kind": st.sampled_from(["still", "pose", "move", "mark", "sign"]) | SCALARS,
    },
    optional={
        "start_s": st.floats(0, 5) | VALUES,
        "end_s": st.floats(5, 9) | VALUES,
        "pose": st.dictionaries(st.sampled_from(ARM.coordinate_names), st.floats(), max_size=2) | VALUES,
        "joints": st.lists(st.sampled_from(ARM.joint_names), max_size=2) | VALUES,
        "axis": st.lists(st.floats(), min_size=3, max_size=3) | VALUES,
        "first": st.sampled_from([1, -1]) | VALUES,
        "stream": st.text(max_size=4) | VALUES,
        "value": st.floats() | VALUES,
        "sign": st.sampled_from([1, -1]) | VALUES,
        "posture_std_rad": st.floats() | VALUES,
    },
)


def check_steps(steps, std_rad):
    def build():
        plan = oarlock.calibration.SessionPlan(
            "plan", [oarlock.calibration.SessionStep(**step) for step in steps], std_rad
        )
        plan.check(ARM)
        return plan

    plan = answered(build)
    if plan is not None:
        repr(plan)
        answered(lambda: oarlock.calibration.calibrate_session(ARM, RECORDING, plan, sensors=["a"]))


def test_steps_of_anything():
    campaign(check_steps, st.lists(STEPS, max_size=3), st.floats(0, 1) | VALUES)


# --- calibrations, every field ----------------------------------------------------------------------------

THREE = (0.01, -0.02, 0.03)
WHOLE = oarlock.Calibration(
    parameters={"l_ua": 0.3},
    mounts={"a": (np.eye(3), THREE)},
    noted={"by": "hand", "list": [1, 2.5, "x"]},
    mag_offsets_ut={"a": (1.0, 2.0, 3.0)},
    parameter_stds={"l_ua": 0.01},
    mount_stds_rad={"a": (0.1, 0.1, 0.2)},
    mount_offset_stds_m={"a": (0.1, 0.1, 0.2)},
    gyro_biases_rad_s={"a": THREE},
    gyro_bias_stds_rad_s={"a": (0.1, 0.1, 0.2)},
    accel_biases_m_s2={"b": THREE},
    accel_scales={"b": (1.01, 0.99, 1.0)},
    mag_matrices={"a": np.eye(3)},
    clocks={"a": oarlock.recording.Clock(0.1, 5e-5, 0.001), "seat": oarlock.recording.Clock(-0.2)},
    encoders={"seat": oarlock.recording.EncoderScale(0.1, -1.0)},
)


def test_whole_calibration_files_and_what_they_correct(tmp_path):
    file = tmp_path / "calibration.toml"
    WHOLE.save(file)
    text = file.read_text(encoding="utf-8")

    def check(harm):
        put(file, wounded(text, harm))
        calibration = answered(lambda: oarlock.load_calibration(file))
        if calibration is None:
            return
        answered(lambda: calibration.corrected(RECORDING))
        calibration.save(file)
        again = oarlock.load_calibration(file)
        assert again.clocks.keys() == calibration.clocks.keys()
        # A file holds tables behind plain keys, so their order may change.
        before, behind = (
            json.dumps(dict(c.noted), default=str, sort_keys=True) for c in (calibration, again)
        )
        assert behind == before

    campaign(check, wounds)


NUMBERS = st.floats() | SCALARS


def check_clock(figures, scale):
    clock = answered(lambda: oarlock.recording.Clock(*figures))
    encoder = answered(lambda: oarlock.recording.EncoderScale(*scale))
    for entries in (
        {} if clock is None else {"clocks": {"a": clock}},
        {} if encoder is None else {"encoders": {"seat": encoder}},
    ):
        known = oarlock.Calibration(**entries)
        found = answered(lambda known=known: known.corrected(RECORDING))
        assert found is None or all(np.isfinite(stream.time_s).all() for stream in found)


def test_clocks_and_encoders():
    campaign(
        check_clock, st.lists(NUMBERS, min_size=1, max_size=4), st.lists(NUMBERS, min_size=1, max_size=2)
    )


# --- counters and device clocks ---------------------------------------------------------------------------

MAPPING = """format = 1
[[file]]
path = "unit.csv"
time = { column = "fine", unit = "us", wraps_at = 4294967296, offset_s = 0.5 }
counter = { column = "count", wraps_at = 65536 }
[[file.sensor]]
name = "back"
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
"""
TICKS = MAPPING.replace(
    'column = "fine", unit = "us", wraps_at = 4294967296',
    'column = "count", unit = "ticks", tick_s = 0.01, wraps_at = 65536',
)
TABLE = "count,fine,gx,gy,gz\n" + "".join(
    f"{(65_520 + k) % 65536},{(2**32 - 100_000 + 10_000 * k) % 2**32},{0.1 * (k % 7):.1f},0.01,0.02\n"
    for k in range(ROWS)
    if k != 9
)


def test_counters_and_clocks_of_devices(tmp_path):
    def check(mapping, harm, table_harm, which):
        put(tmp_path / "mapping.toml", wounded(mapping, harm) if which else mapping)
        put(tmp_path / "unit.csv", TABLE if which else wounded(TABLE, table_harm))
        check_recording(lambda: read_csv(tmp_path / "mapping.toml"))

    campaign(check, st.sampled_from([MAPPING, TICKS]), wounds, wounds, st.booleans())


def check_recording(read):
    """What is looked at before tracking works for whatever was read."""
    recording = answered(read)
    if recording is None:
        return
    repr(recording)
    for stream in recording:
        answered(lambda stream=stream: lost_packets(recording, stream))
    answered(lambda: plausibility(recording))


def test_meta_of_packets(tmp_path):
    recording = oarlock.Recording(
        RECORDING.streams,
        {"packets": {"a": {"after_s": [0.1, 0.4], "packets": [2.0, 1.0], "step_s": [0.02]}}},
    )
    recording.save(tmp_path)
    (tmp_path / "oarlock-manifest.toml").unlink()  # else its hashes answer for the reader
    index = tmp_path / "recording.toml"
    text = index.read_text(encoding="utf-8")
    start = text.index("[meta")

    def check(harm):
        put(index, text[:start] + wounded(text[start:], harm))
        check_recording(lambda: oarlock.load_recording(tmp_path))

    campaign(check, wounds)
