"""Studies: what they refuse, that they repeat themselves on any number of processes, that they do what they say."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from pyarrow import csv, parquet

import oarlock
from command_line import run
from oarlock.evaluation.study.degrade import degraded, keys_of_streams
from oarlock.evaluation.study.filter_inputs import filter_calibration, filter_model, keys_of_filter_inputs
from oarlock.evaluation.study.pool import UNFINISHED, identity, rows_of_studies
from oarlock.evaluation.study.rows import write_rows
from oarlock.evaluation.study.run import groups, run_group
from oarlock.report.study_page import study_page
from oarlock.rowing import SIMULATORS
from refusals import assert_refused

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples/studies").glob("*.toml"))
HEAD = 'format = 1\nmodel = "sculler"\nsimulator = "sculling"\nseeds = 1\n'


def swing(folder: Path, tmp_path: Path, grid: str = "noise_factor = [1, 4]") -> oarlock.studies.Study:
    file = tmp_path / "swing.toml"
    file.write_text(
        f'format = 1\nmodel = "pendulum3"\nmotion = "{folder}"\nseeds = [3, 4]\nstart_s = 1.0\n'
        f"[fixed]\nduration_s = 3.0\n[grid]\n{grid}\n"
    )
    return oarlock.studies.load_study(file)


def test_any_model_along_a_motion_from_a_folder(pendulum_motion, tmp_path):
    result = oarlock.studies.run_study(swing(pendulum_motion, tmp_path), jobs=1)
    assert not result.complaints
    little, much = result.scores().mean(axis=1)
    assert 0.0 < 1.5 * little < much, "four times the noise, at least half as much error again"


def test_rows_are_the_same_bits_on_one_process_and_on_two(pendulum_motion, tmp_path):
    study = swing(pendulum_motion, tmp_path, grid='rate_hz = [60, 120]\nconfig.filter = ["ukf", "ekf"]')
    assert len(groups(study)) == 4  # two rates, two seeds; the filters share a trial
    alone, together = (oarlock.studies.run_study(study, jobs=jobs) for jobs in (1, 2))
    assert json.dumps(alone.rows) == json.dumps(together.rows)


def test_studies_that_share_processes_and_a_folder_have_their_own_rows(pendulum_motion, tmp_path):
    few = swing(pendulum_motion, tmp_path)
    many = swing(pendulum_motion, tmp_path, grid="rate_hz = [60, 120]")
    whole = [list(oarlock.studies.run_study(study, jobs=1).rows) for study in (few, many)]
    out = tmp_path / "out"

    def stop(done: float) -> None:
        if done >= 0.75:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rows_of_studies((few, many), 2, out, stop)
    kept = (out / UNFINISHED).read_text(encoding="utf-8").splitlines()
    assert len(kept) >= 2
    begun: list[float] = []
    again = rows_of_studies((few, many), 2, out, begun.append)
    assert json.dumps(again) == json.dumps(whole)
    assert len(begun) == len(groups(few)) + len(groups(many)) - len(kept), "what was done is not done again"


def test_a_stopped_study_goes_on_and_ends_in_the_same_rows(pendulum_motion, tmp_path):
    study = swing(pendulum_motion, tmp_path)
    whole = oarlock.studies.run_study(study, jobs=1)
    out = tmp_path / "out"

    def stop(done: float) -> None:
        if done >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        oarlock.studies.run_study(study, jobs=1, folder=out, progress=stop)
    kept = (out / UNFINISHED).read_text(encoding="utf-8").splitlines()
    assert kept and all(json.loads(line)["study"] == identity(study) for line in kept)
    (out / UNFINISHED).write_text("\n".join([*kept, '{"study": "cut of']))
    begun: list[float] = []
    again = oarlock.studies.run_study(study, jobs=1, folder=out, progress=begun.append)
    assert json.dumps(again.rows) == json.dumps(whole.rows)
    assert len(begun) < study.run_count, "what was done is not done again"
    assert not (out / UNFINISHED).exists()


def test_a_failing_run_is_a_row_with_its_error(sculler):
    study = oarlock.studies.Study(
        sculler,
        SIMULATORS["sculling"],
        seeds=(0,),
        fixed={"duration_s": 4.0},
        scenarios={"short arms": {"parameters.l_ua_r": 0.1}, "usual": {}},
    )
    result = oarlock.studies.run_study(study, jobs=1)
    assert [row["name"] for row in result.failures] == ["short arms"]
    assert "beyond the stretched arm" in result.failures[0]["error"]
    assert math.isnan(result.scores()[0, 0]) and result.scores()[1, 0] < 1.0
    assert "beyond the" in study_page(result)


def test_a_mean_over_joints_that_nothing_observes_says_so(sculler):
    study = oarlock.studies.Study(
        sculler,
        SIMULATORS["sculling"],
        seeds=(0,),
        fixed={"duration_s": 4.0, "sensors": ["back", "seat"]},
        joints=("trunk", "l_elbow_flexion"),
    )
    (row,) = oarlock.studies.run_study(study, jobs=1).complaints
    assert row["kind"] == "mean" and "do not observe l_elbow_flexion" in row["error"]


def test_tables_hold_a_row_for_each_run_and_joint(pendulum_motion, tmp_path):
    study = swing(pendulum_motion, tmp_path)
    result = oarlock.studies.run_study(study, jobs=1)
    result.save(tmp_path)
    runs, summary = (parquet.read_table(tmp_path / f"{name}.parquet") for name in ("runs", "summary"))
    assert csv.read_csv(tmp_path / "runs.csv").num_rows == runs.num_rows == len(result.rows)
    names = set(oarlock.load_model("pendulum3").joint_names)
    joints = [row for row in runs.to_pylist() if row["kind"] == "joint"]
    assert len(joints) == 4 * len(names) and {row["item"] for row in joints} == names
    one = next(row for row in summary.to_pylist() if row["kind"] == "mean" and row["noise_factor"] == 4.0)
    errors = np.array(
        [r["rmse"] for r in runs.to_pylist() if r["kind"] == "mean" and r["noise_factor"] == 4.0]
    )
    half = 12.706 * errors.std(ddof=1) / math.sqrt(2)  # Student, one degree of freedom
    assert one["rmse_mean"] == pytest.approx(errors.mean())
    assert one["rmse_high_95"] - one["rmse_mean"] == pytest.approx(half, rel=1e-3)


def test_a_key_that_is_a_number_here_and_a_table_there_is_a_text_column(tmp_path):
    rows = [{"delay_s": 0.0, "start_error_deg": None}, {"delay_s": "back 0.01", "start_error_deg": 5.0}]
    write_rows(rows, tmp_path / "mixed")
    assert parquet.read_table(tmp_path / "mixed.parquet").to_pylist() == [
        {"delay_s": "0", "start_error_deg": None},
        {"delay_s": "back 0.01", "start_error_deg": 5.0},
    ]


# --- what is done to a recording, and what the filter is told -----------------------------------------


def streams(model, **changed):
    return {name: key.default for name, key in keys_of_streams(model).items()} | changed


def test_nothing_is_done_unless_asked(sculler, four_seconds):
    same = degraded(four_seconds.recording, streams(sculler), 0)
    assert all(np.array_equal(a.time_s, b.time_s) for a, b in zip(same, four_seconds.recording, strict=True))


def test_loss_delay_and_thinning_do_what_they_say(sculler, four_seconds):
    values = streams(
        sculler,
        packet_loss={"back": 0.25},
        delay_s=0.02,
        keep_every={"r_forearm": 5.0},
        without=["seat"],
        without_quantity=["mag_ut"],
    )
    spoilt, whole = degraded(four_seconds.recording, values, 1), four_seconds.recording
    assert "seat" not in spoilt
    assert set(spoilt["back"].values) == {"gyro_rad_s", "accel_m_s2"}
    # 500 draws with probability 1/4: six standard deviations
    assert len(spoilt["back"]) == pytest.approx(0.75 * len(whole["back"]), abs=6 * math.sqrt(500 * 3 / 16))
    assert len(spoilt["r_forearm"]) == math.ceil(len(whole["r_forearm"]) / 5)
    assert np.allclose(spoilt["l_forearm"].time_s, whole["l_forearm"].time_s + 0.02)
    assert np.array_equal(spoilt["r_oar_phi"].time_s, whole["r_oar_phi"].time_s), (
        "a number is meant for units"
    )
    again = degraded(four_seconds.recording, values, 1)
    assert np.array_equal(again["back"].time_s, spoilt["back"].time_s)


def model_values(model, **changed):
    lengths = SIMULATORS["sculling"].lengths(model)
    return {name: key.default for name, key in keys_of_filter_inputs(model, lengths).items()} | changed


def test_mounts_are_wrong_by_exactly_the_angle(sculler):
    lengths = SIMULATORS["sculling"].lengths(sculler)
    assert filter_calibration(sculler, lengths, model_values(sculler), 0) is None
    five, ten = (
        filter_calibration(sculler, lengths, model_values(sculler, mount_error_deg=angle), 7)
        for angle in (5.0, 10.0)
    )
    for sensor in (s for s in sculler.describe().inertial_units):
        off = [np.asarray(sensor.mount.rotation).T @ c.mounts[sensor.name][0] for c in (five, ten)]
        angles = [math.degrees(math.acos((np.trace(r) - 1.0) / 2.0)) for r in off]
        assert angles == pytest.approx([5.0, 10.0], abs=1e-6)
        assert np.allclose(off[0] @ off[0], off[1], atol=1e-9), "the same axis for one seed"


def test_lengths_of_the_body_are_wrong_and_the_rig_is_not(sculler):
    lengths = SIMULATORS["sculling"].lengths(sculler)
    wrong = filter_calibration(sculler, lengths, model_values(sculler, length_error_percent=5.0), 2)
    assert set(wrong.parameters) == set(lengths) and "l_oar_r" not in lengths and "r_pin_x" not in lengths


def test_the_filter_is_told_the_noise_unless_it_is_not(sculler):
    known = filter_model(sculler, model_values(sculler, gyro_noise_factor=3.0), 0)
    blind = filter_model(sculler, model_values(sculler, gyro_noise_factor=3.0, noise_told="nominal"), 0)
    gyro = [m.describe().sensors[0].gyro_std_rad_s for m in (sculler, known, blind)]
    assert gyro[1] == pytest.approx(3.0 * gyro[0]) and gyro[2] == gyro[0]


def test_a_key_of_the_model_file_is_changed_for_the_filter_alone(sculler):
    loose = filter_model(sculler, model_values(sculler) | {"model.closure.r_grip.std_m": 0.01}, 0)
    assert [c.std_m for c in loose.describe().closures] == [0.01, 0.002]


def test_a_group_simulates_once_and_smoothing_filters_once(sculler):
    study = oarlock.studies.Study(
        sculler,
        SIMULATORS["sculling"],
        seeds=(0,),
        fixed={"duration_s": 4.0},
        grid={"smooth": [False, True], "condition": ["S-NB", "B-B"]},
    )
    assert [len(group.scenarios) for group in groups(study)] == [2, 2]
    rows = [row for row in run_group(study, groups(study)[1]) if row["kind"] == "mean"]
    assert rows[1]["rmse"] < rows[0]["rmse"], "smoothed is better than filtered"


def test_the_field_has_its_effects_as_keys(sculler):
    study = oarlock.studies.Study(
        sculler,
        SIMULATORS["field"],
        seeds=(0,),
        fixed={"duration_s": 4.0},
        scenarios={
            "nothing": {"strength": 0.0},
            "mounts": {"only_effects": ["mounts"], "effect.mount_error_rad": 0.1},
        },
    )
    clean, spoilt = oarlock.studies.run_study(study, jobs=1).scores()[:, 0]
    # 0.6 and 1.5 deg: mounts may be off by 3 deg as far as 4 s of movement show, and bands say so
    assert clean < 0.9 < spoilt


# --- what is refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[grid]\nmount_eror_deg = [1]\n", (':6, key "mount_eror_deg" of [grid]', 'mean "mount_error_deg"')),
        ("[grid]\nrate_hz = 100\n", (":6", "needs a list of values")),
        ("[grid]\nconfig.filtre = ['ukf']\n", (':6, key "filtre" of [grid.config]', 'mean "filter"')),
        ("[grid]\nconfig.filter = ['ukff']\n", (":6", "is refused", "ukff")),
        ("[fixed]\nparameters.l_uar_r = 0.3\n", (":6", 'mean "l_ua_r"')),
        ("[fixed]\nmodel.closure.r_gripp.std_m = 0.3\n", ("no entry", 'mean "r_grip"')),
        ("[fixed]\npacket_loss = 1.5\n", (":6", "is 1.5; expected 0 to 0.99")),
        ("[fixed]\nwithout = ['bac']\n", (":6", 'mean "back"')),
        ("[fixed]\ncondition = 'B-BB'\n", (":6", 'mean "B-B"')),
        ("[[scenario]]\nrate_hz = 100\n", ('the key "name" is missing',)),
        ("joints = ['elbow']\n", ('has no "elbow"',)),
        ("girds = 1\n", (':5, key "girds"', 'mean "grid"')),
    ],
)
def test_a_wrong_key_is_refused_with_its_line_and_the_nearest_name(tmp_path, text, says):
    file = tmp_path / "wrong.toml"
    file.write_text(HEAD + text)
    assert_refused(lambda: oarlock.studies.load_study(file, SIMULATORS), str(file), *says)


def test_in_python_too(sculler):
    with pytest.raises(oarlock.DataError, match=r'"rate_hertz" is not known\. Did you mean "rate_hz"'):
        oarlock.studies.Study(sculler, SIMULATORS["sculling"], fixed={"rate_hertz": 100.0})
    assert_refused(
        lambda: oarlock.studies.run_study(oarlock.studies.Study(sculler, SIMULATORS["sculling"]), jobs=0),
        "jobs = 0",
    )


# --- the command line ---------------------------------------------------------------------------------


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_shipped_studies_are_read_and_can_be_made(file):
    study = oarlock.studies.load_study(file, SIMULATORS)
    assert study.run_count >= 30 and study.about and study.title
    assert oarlock.studies.load_study(file, SIMULATORS, seeds=range(2)).seeds == (0, 1)


def test_the_verb_writes_tables_and_a_page_that_needs_nothing(pendulum_motion, tmp_path):
    file = tmp_path / "s.toml"
    file.write_text(
        f'format = 1\ntitle = "Swing"\nmodel = "pendulum3"\nmotion = "{pendulum_motion}"\nseeds = 2\nstart_s = 1.0\n'
        "[fixed]\nduration_s = 3.0\n[grid]\nnoise_factor = [1, 2, 4]\n"
    )
    out = tmp_path / "out"
    ran = run("lab", "study", str(file), "--out", str(out), "--jobs", "1", "--json")
    assert json.loads(ran.stdout)["runs"] == 6
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<svg" in page and "series-band" in page and "http" not in page.replace("http-equiv", "")
    assert {"runs.csv", "runs.parquet", "summary.csv", "summary.parquet", "run.toml"} <= {
        path.name for path in out.iterdir()
    }
    keys = run("lab", "study", str(file), "--keys")
    assert "mount_error_deg" in keys.output
    run("lab", "study", str(file), status=2)
