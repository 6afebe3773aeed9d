"""Faults of recordings: each does what it says and nothing else; sweeps, what they cost, and the page of it."""

import json
import math
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyarrow import csv

import oarlock
from command_line import run
from exact_recording import UNITS
from oarlock.evaluation.study.costs import doses, ranked
from oarlock.evaluation.study.faults.catalogue import afflicted, faults_of, keys_of_faults
from oarlock.evaluation.study.filter_inputs import filter_model
from oarlock.evaluation.study.keys import with_turns
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.run import MEAN, SCORES
from oarlock.evaluation.study.spec import keys_of
from oarlock.report.fault_page import fault_picture, findings
from oarlock.report.study_page import study_page
from oarlock.rowing import SIMULATORS
from refusals import assert_refused

ROUNDING = 1e-9
"""rad, or a share: what is left of exact turns of double numbers."""


@pytest.fixture(scope="module")
def trial(four_seconds) -> oarlock.studies.StudyTrial:
    return four_seconds


@pytest.fixture(scope="module")
def still(sculler) -> oarlock.studies.StudyTrial:
    """A posture that lasts, without noise: accelerometers point up, whatever kinematics say."""
    time_s = np.linspace(0.0, 4.0, 400)
    joints = {name: np.full(400, 0.1 * k) for k, name in enumerate(sculler.joint_names)}
    motion = oarlock.simulation.Motion.from_joints(time_s, joints)
    return oarlock.studies.StudyTrial(*oarlock.simulate(sculler, motion, noise=False, rate_hz=50.0))


def spoilt(trial, seed=0, **changed) -> oarlock.Recording:
    model = trial.truth.model
    values = {name: key.default for name, key in keys_of_faults(model).items()} | changed
    return afflicted(trial, model, with_turns(values, UNITS, seed), seed)


def changed_streams(trial, recording) -> set[str]:
    def same(a, b):
        return np.array_equal(a.time_s, b.time_s) and all(
            np.array_equal(a.values[name], rows) for name, rows in b.values.items()
        )

    return {s.name for s in trial.recording if s.name not in recording or not same(s, recording[s.name])}


def test_nothing_is_done_unless_asked(trial):
    assert spoilt(trial) is trial.recording


def test_one_is_another_unit_for_each_seed(trial):
    hit = [changed_streams(trial, spoilt(trial, seed, gap_s={"one": 0.5})) for seed in range(5)]
    assert hit == [{name} for name in UNITS]
    assert with_turns({"without": ["one", "seat"]}, UNITS, 7) == {"without": ["r_forearm", "seat"]}


def test_a_gap_takes_as_many_samples_as_it_lasts_and_all_streams_share_it(trial):
    whole, gone = trial.recording, spoilt(trial, 3, gap_s=0.4)
    for stream in whole:
        lost = sorted(set(stream.time_s) - set(gone[stream.name].time_s))
        assert len(lost) == 50, "0.4 s at 125 Hz"
        assert lost[-1] - lost[0] == pytest.approx(0.4 - 1 / 125)
        assert whole.start_s + 1.0 <= lost[0] and lost[-1] <= whole.end_s, "after the first quarter"
    starts = {min(set(s.time_s) - set(gone[s.name].time_s)) for s in whole}
    assert len(starts) == 1


def test_a_gap_over_everything_is_refused(trial):
    assert_refused(lambda: spoilt(trial, gap_s=100.0), "leaves no stream")


def test_a_stuck_unit_repeats_one_reading(trial):
    stuck = spoilt(trial, 1, stuck_s={"back": 0.4})
    assert changed_streams(trial, stuck) == {"back"}
    rows = stuck["back"].gyro_rad_s
    assert np.sum((np.diff(rows, axis=0) == 0.0).all(axis=1)) == 49, "50 equal ones at 125 Hz"
    assert np.array_equal(stuck["back"].time_s, trial.recording["back"].time_s)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("angle", [10.0, 60.0])
def test_heading_turns_about_the_vertical_and_leaves_dip_and_norm(still, seed, angle):
    turned = spoilt(still, seed, heading_turn_deg=angle, disturbed_s=1.0)
    assert changed_streams(still, turned) == set(UNITS)
    for name in UNITS:
        unit, was = turned[name], still.recording[name]
        now = (unit.mag_ut != was.mag_ut).any(axis=1)
        assert now.sum() == 50, "1 s at 50 Hz"
        up = was.accel_m_s2 / np.linalg.norm(was.accel_m_s2, axis=1, keepdims=True)
        before, after = was.mag_ut[now], unit.mag_ut[now]
        height = [np.sum(m * up[now], axis=1) for m in (before, after)]
        level = [m - h[:, None] * up[now] for m, h in zip((before, after), height, strict=True)]
        assert np.allclose(*height, atol=ROUNDING * 47.0), "the part along the vertical stays"
        sine = np.sum(np.cross(*level) * up[now], axis=1)
        found = np.degrees(np.arctan2(sine, np.sum(level[0] * level[1], axis=1)))
        assert np.allclose(np.abs(found), angle, atol=np.degrees(ROUNDING)), "by the angle"
        assert len(set(np.sign(found))) == 1, "to one side"


def test_dip_tilts_and_norm_stretches(still):
    was = still.recording["back"]
    up = was.accel_m_s2 / np.linalg.norm(was.accel_m_s2, axis=1, keepdims=True)

    def dip_deg(unit):
        return np.degrees(np.arcsin(-np.sum(unit.mag_ut * up, axis=1) / np.linalg.norm(unit.mag_ut, axis=1)))

    tilted = spoilt(still, dip_turn_deg={"back": 12.0}, disturbed_s=1.0)["back"]
    off = np.abs(dip_deg(tilted) - dip_deg(was))
    assert off.max() == pytest.approx(12.0, abs=1e-6) and np.sum(off > 1.0) == 50
    weak = spoilt(still, field_error_percent={"back": 30.0}, disturbed_s=1.0)["back"]
    ratio = np.linalg.norm(weak.mag_ut, axis=1) / np.linalg.norm(was.mag_ut, axis=1)
    assert {round(value, 9) for value in ratio} in ({1.0, 0.7}, {1.0, 1.3})


def test_gyroscopes_are_cut_off_at_their_range(trial):
    cut = spoilt(trial, gyro_range_deg_s=60.0)
    assert max(float(np.abs(cut[name].gyro_rad_s).max()) for name in UNITS) == pytest.approx(
        math.radians(60.0)
    )
    kept = np.abs(trial.recording["back"].gyro_rad_s) < math.radians(60.0)
    assert np.array_equal(cut["back"].gyro_rad_s[kept], trial.recording["back"].gyro_rad_s[kept])


def test_exchanged_units_have_each_others_readings(trial):
    mixed = spoilt(trial, exchanged=["r_forearm", "l_forearm"])
    assert mixed.names == trial.recording.names
    assert changed_streams(trial, mixed) == {"r_forearm", "l_forearm"}
    assert np.array_equal(mixed["r_forearm"].gyro_rad_s, trial.recording["l_forearm"].gyro_rad_s)
    with pytest.raises(oarlock.DataError, match="expected pairs of different units"):
        spoilt(trial, exchanged=["r_forearm", "r_forearm"])


def test_encoders_count_the_wrong_way_or_from_another_zero(trial):
    wrong = spoilt(trial, wrong_sign=["seat"], encoder_offset_deg={"r_oar_phi": 2.0})
    assert changed_streams(trial, wrong) == {"seat", "r_oar_phi"}
    assert np.array_equal(wrong["seat"].value, -trial.recording["seat"].value)
    off = wrong["r_oar_phi"].value - trial.recording["r_oar_phi"].value
    assert np.allclose(np.abs(off), math.radians(2.0)) and np.ptp(off) < ROUNDING
    angles = changed_streams(trial, spoilt(trial, encoder_offset_deg=1.0))
    assert angles == {"r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha"}
    assert changed_streams(trial, spoilt(trial, encoder_offset_m=0.01)) == {"seat"}


def test_stamps_are_scattered_and_stay_in_order(trial):
    for std_s, expected in ((0.0005, 0.0005), (1.0, 0.45 / 125)):
        unit = spoilt(trial, clock_jitter_s=std_s)["back"]
        off = unit.time_s - trial.recording["back"].time_s
        # 500 draws: 10 % is three standard deviations of their spread
        assert off.std() == pytest.approx(expected, rel=0.1)
        assert (np.diff(unit.time_s) > 0.0).all()


def test_the_filters_vertical_is_wrong_by_exactly_the_angle(sculler):
    values = {name: key.default for name, key in keys_of(sculler, SIMULATORS["sculling"]).items()}
    sides = set()
    for seed in range(4):
        world = filter_model(sculler, values | {"vertical_error_deg": 3.0}, seed).describe().world
        up, forward = np.asarray(world.up), np.asarray(world.forward)
        assert math.degrees(math.acos(up @ [0.0, 1.0, 0.0])) == pytest.approx(3.0, abs=1e-6)
        assert abs(up @ forward) < ROUNDING
        sides.add(round(float(math.atan2(up[0], up[2])), 3))
    assert len(sides) == 4


def test_every_fault_has_its_unit_or_kind_and_says_what_it_does(sculler):
    keys = [fault.key for fault in faults_of(sculler)]
    assert len({key.name for key in keys}) == len(keys)
    assert all(key.about and key.choices for key in keys)


# --- sweeps -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swung(pendulum_motion, tmp_path_factory) -> Path:
    """A study of faults of a body without oars, as a file."""
    file = tmp_path_factory.mktemp("faults") / "faults.toml"
    file.write_text(
        f'format = 1\nmodel = "pendulum3"\nmotion = "{pendulum_motion}"\nseeds = 2\nstart_s = 1.0\n'
        "[fixed]\nduration_s = 3.0\n"
        '[[setting]]\nname = "default"\n[[setting]]\nname = "no gate"\nconfig.gate = false\n'
        '[[fault]]\nname = "unit turned"\nkey = "mount_error_deg"\nof = ["one"]\nstrengths = [5, 20]\nunit = "deg"\n'
        'says = "a unit turned by {}"\n'
        '[[fault]]\nname = "late"\nkey = "delay_s"\nstrengths = [0.0001]\nunit = "s"\n'
    )
    return file


def test_a_sweep_runs_each_fault_alone_under_every_setting(swung, tmp_path):
    study = oarlock.studies.load_study(swung)
    assert study.run_count == 2 * 2 * (1 + 2 + 1)
    assert [s.name for s in study.expanded()][:4] == [
        "default: no fault",
        "default: unit turned, 5 deg",
        "default: unit turned, 20 deg",
        "default: late, 0.1 ms",
    ]
    result = oarlock.studies.run_study(study, jobs=1)
    assert not result.complaints
    found = doses(result.study, result.rows)
    usual = {(d.fault.name if d.fault else "", d.label): d for d in found if d.setting == "default"}
    little, much = usual["unit turned", "5 deg"], usual["unit turned", "20 deg"]
    assert 0.0 < little.cost_deg < much.cost_deg and much.noticed
    assert not usual["late", "0.1 ms"].noticed
    assert [fault.name for fault in ranked(found)] == ["unit turned", "late"]
    result.save(tmp_path)
    rows = json.loads((tmp_path / "faults.json").read_text(encoding="utf-8"))
    assert len(rows) == csv.read_csv(tmp_path / "faults.csv").num_rows == 8
    assert rows[2]["rmse_median_deg"] == pytest.approx(much.median_deg)
    page = study_page(result)
    assert "a unit turned by 5 deg" in page and "No measurable effect" in page
    assert fault_picture(result).count("<g ") >= 2


def made_up(errors: dict[str, list[float]]) -> StudyResult:
    """A result with these errors, by dose; a run that failed is NaN."""
    faults = tuple(
        oarlock.studies.FaultSweep(name, "delay_s", (0.01, 0.02), unit="s")
        for name in dict.fromkeys(k[0] for k in errors)
    )
    study = oarlock.studies.Study(
        oarlock.load_model("sculler"), SIMULATORS["sculling"], seeds=range(3), faults=faults
    )
    rows = []
    for scenario in study.expanded():
        name, label = scenario.swept["fault"], scenario.swept["label"]
        given = errors.get((name, label), [0.1, 0.1, 0.1])
        for seed, error in enumerate(given):
            row = {"scenario": scenario.index, "name": scenario.name, "seed": seed, "swept": scenario.swept}
            kind = "run" if math.isnan(error) else "mean"
            scores = dict.fromkeys(SCORES, math.nan) | {"rmse": error, "coverage_95": 0.9}
            text = "lost" if kind == "run" else ""
            rows.append({**row, "kind": kind, "item": MEAN, "unit": "deg", **scores, "error": text})
    return StudyResult(study, tuple(rows))


def test_what_is_lost_is_counted_and_drags_no_mean():
    result = made_up(
        {
            ("mild", "10 ms"): [0.1, 0.1, 0.105],
            ("mild", "20 ms"): [0.2, 0.3, 0.4],
            ("bad", "10 ms"): [1.0, 2.0, math.nan],
            ("bad", "20 ms"): [50.0, math.nan, math.nan],
        }
    )
    found = doses(result.study, result.rows)
    by_name = {(d.fault.name, d.label): d for d in found if d.fault}
    assert by_name["bad", "10 ms"].median_deg == 2.0 and by_name["bad", "10 ms"].lost == 1
    assert by_name["bad", "20 ms"].lost == 3 and math.isinf(by_name["bad", "20 ms"].median_deg)
    assert by_name["mild", "20 ms"].cost_deg == pytest.approx(0.2)
    assert not by_name["mild", "10 ms"].noticed
    assert [fault.name for fault in ranked(found)] == ["bad", "mild"]
    clean = {"default": found[0]}
    curves = {n: {"default": [d for d in found if d.fault and d.fault.name == n]} for n in ("bad", "mild")}
    said = dict(findings(clean, curves))
    assert said["Track lost in at least one seed:"] == "bad, 10 ms (1 of 3)."
    assert said["No measurable effect:"] == "mild, 10 ms."
    assert said["Largest errors at typical strength:"] == "bad, 10 ms (+1.9 deg, 1 of 3 lost)."


def test_page_and_picture_hold_no_nan_and_name_what_they_draw():
    result = made_up({("bad", "10 ms"): [1.0, 2.0, math.nan], ("bad", "20 ms"): [math.nan] * 3})
    for text in (study_page(result), fault_picture(result)):
        drawn = re.sub(r"<style>.*?</style>", "", text, flags=re.S)
        assert not re.search(r"[\s\"](?:nan|inf)\b", drawn)
    page = study_page(result)
    assert page.count('role="img"') == page.count("<desc") and "Median error of the angles in deg" in page


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            'key = "gap_ss"\nstrengths = [1]\n',
            ('mean "gap_s"', ':8, key "key" of [fault[1]]: "gap_ss" is not known'),
        ),
        (
            'key = "gap_s"\nstrengths = [-1]\n',
            (':9, key "strengths" of [fault[1]]: "gap_s" is -1; expected 0 or more',),
        ),
        ('key = "gap_s"\nstrengths = []\n', ("strengths is empty",)),
        ('key = "gap_s"\nstrengths = [1]\nof = ["backk"]\n', ('mean "back"',)),
        ('key = "gap_s"\nstrengths = [1, 2]\nusual = 3\n', ("is not one of its strengths [1, 2]",)),
        ('key = "gap_s"\nstrengths = [1, 2]\nlabels = ["a"]\n', ("1 labels for 2 strengths",)),
        ('key = "gap_s"\nstrengths = [1]\nsays = "silent"\n', ("expected one {}",)),
        ('key = "gap_s"\nstrength = [1]\n', ('mean "strengths"',)),
        ('key = "gap_s"\nstrengths = [1]\n[grid]\nrate_hz = [50]\n', ("not both",)),
    ],
)
def test_a_wrong_fault_is_refused(tmp_path, text, says):
    file = tmp_path / "wrong.toml"
    head = 'format = 1\nmodel = "sculler"\nsimulator = "sculling"\nseeds = 1\n\n[[fault]]\nname = "silent"\n'
    file.write_text(head + text)
    assert_refused(lambda: oarlock.studies.load_study(file, SIMULATORS), *says)


def test_a_shipped_study_is_known_by_name():
    keys = run("lab", "study", "robustness", "--keys", "--json")
    assert "gap_s" in json.loads(keys.stdout)["keys"]
    wrong = run("lab", "study", "robustnes", "--keys", status=1)
    assert 'mean "robustness"' in wrong.output


def test_the_shipped_study_has_every_group_of_effects():
    from oarlock.rowing.field.effects import GROUPS

    study = oarlock.studies.load_study("robustness", SIMULATORS)
    alone = {name for fault in study.faults for name in fault.meanwhile.get("only_effects", ())}
    assert alone == set(GROUPS)


# --- processes ----------------------------------------------------------------------------------------

_STUDY = """
import sys
import oarlock

def tell(share):
    print("working", flush=True)

if __name__ == "__main__":
    oarlock.studies.run_study(oarlock.studies.load_study(sys.argv[1], seeds=range(400)), jobs=2, progress=tell)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="a pipe's end is not inherited there")
def test_workers_end_with_their_parent(swung, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(_STUDY)
    command = [sys.executable, str(script), str(swung)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as parent:
        assert parent.stdout is not None and parent.stdout.readline() == "working\n"
        parent.terminate()
        # the workers hold the other end of this pipe: it closes when the last of them is gone
        parent.communicate()
        assert parent.returncode == -signal.SIGTERM
