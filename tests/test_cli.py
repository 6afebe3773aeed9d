"""The command line: help, exit status, one JSON document, errors as one block on stderr."""

import json
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import oarlock
from command_line import run
from oarlock.cli import VERBS as EVERY
from oarlock.cli import load_verb, settings, terminal
from oarlock.cli.lab import IN_OARLOCK_LAB

VERBS = (
    *((verb,) for verb in ("demo", "simulate", "track", "evaluate", "report")),
    *(("lab", verb) for verb in ("bench", "compare", "emulate", "reproduce", "season", "study")),
    *(("export",), ("import", "apdm"), ("import", "csv"), ("calibrate", "chain"), ("calibrate", "session")),
    *(("run",), ("calibrate", "sagittal"), ("rowing", "strokes")),
    *(("model", verb) for verb in ("list", "show", "check", "copy")),
)

BROKEN_MODEL = """\
format = 1
name = "broken"

[world]
up = [0, 1, 0]
forward = [0, 0, 1]

[[joint]]
name = "swing"
kind = "hinge"
limts = [-1, 1]

[[frame]]
name = "link"
parent = "root"
joint = "swing"
dh = { a = 0.3, alpha = 0, d = 0, theta = 0 }
"""


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of three seconds with its truth, and what `track` made of it."""
    folder = tmp_path_factory.mktemp("cli")
    run("simulate", "--out", folder / "trial", "--duration-s", 3)
    run("track", folder / "trial", "--model", "sculler", "--out", folder / "out", "--csv")
    return folder


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_help_says_what_it_does_and_gives_examples(verb):
    shown = run(*verb, "--help")
    assert f"Usage: oarlock {' '.join(verb)}" in shown.stdout
    examples = shown.stdout.partition("Examples:")[2]
    assert f"oarlock {' '.join(verb)}" in examples


def test_verbs_of_oarlock_lab_say_how_to_install_it(monkeypatch):
    lab = load_verb("lab")
    assert set(lab.commands) == {"compare", "study", *IN_OARLOCK_LAB}
    without = {name: verb for name, verb in lab.commands.items() if name != "bench"}
    monkeypatch.setattr(lab, "commands", without)
    assert "pip install oarlock-lab" in " ".join(run("lab", "bench", status=2).stderr.split())


def test_version():
    shown = run("--version")
    assert shown.stdout.startswith("oarlock ")


def test_without_a_verb_three_ways_to_begin_are_shown():
    shown = run().stdout
    commands = re.findall(r"^  oarlock (\S+)", shown, re.M)
    assert {"demo", "run", "track", "rowing", "model"} <= set(commands) <= set(EVERY)
    assert max(map(len, shown.splitlines())) <= terminal.WIDTH


# --- model --------------------------------------------------------------------------------------------


def test_model_list_names_the_shipped_models():
    listed = {entry["name"] for entry in json.loads(run("model", "list", "--json").stdout)}
    assert {"sculler", "pendulum3"} <= listed


def test_model_show_holds_every_part_within_100_columns():
    shown = run("model", "show", "sculler")
    parts = ("Parameters", "Joints", "Frames", "Sensors", "Closures", "State", "Measurement", "Pose")
    headings = [line.split("  ")[0] for line in shown.stdout.splitlines()]
    assert [part for part in parts if part not in headings] == []
    assert max(map(len, shown.stdout.splitlines())) <= terminal.WIDTH
    assert "\x1b" not in shown.stdout
    assert not any(line != line.rstrip() for line in shown.stdout.splitlines())


def test_model_show_json_lists_the_measurement_rows():
    description = json.loads(run("model", "show", "sculler", "--json").stdout)
    assert len(description["measurement_names"]) == 58
    assert len(description["frames"]) == 26
    assert description["joints"][0]["name"] == "seat"


def test_model_show_writes_svg_and_takes_a_pose(tmp_path):
    at_rest, leaning = tmp_path / "rest.svg", tmp_path / "lean.svg"
    run("model", "show", "sculler", "--svg", at_rest)
    run("model", "show", "sculler", "--svg", leaning, "--at", "trunk=-0.4")
    assert at_rest.read_text(encoding="utf-8").startswith("<svg")
    assert at_rest.read_text(encoding="utf-8") != leaning.read_text(encoding="utf-8")


def test_an_unknown_joint_in_a_pose_is_a_usage_error_with_the_nearest_name():
    refused = run("model", "show", "sculler", "--at", "trnk=0", status=2)
    assert "trunk" in refused.stderr


def test_model_check_accepts_what_is_shipped():
    checked = run("model", "check", "sculler")
    assert "58 rows" in checked.stdout


def test_model_check_explains_a_broken_file(tmp_path):
    file = tmp_path / "broken.toml"
    file.write_text(BROKEN_MODEL)
    checked = run("model", "check", file, status=1)
    assert checked.stdout == ""
    assert "limts" in checked.stderr and "limits" in checked.stderr
    assert "Traceback" not in checked.stderr
    document = json.loads(run("model", "check", file, "--json", status=1).stdout)
    assert document["ok"] is False
    assert any("limts" in mistake for mistake in document["mistakes"])


def test_model_copy_is_a_fine_model_and_is_not_overwritten(tmp_path):
    file = tmp_path / "my.toml"
    copied = run("model", "copy", "sculler", file)
    # Wherever the terminal has broken the line.
    assert f"oarlockmodelcheck{file}" in "".join(copied.stdout.split())
    run("model", "check", file)
    file.write_text("mine")
    run("model", "copy", "sculler", file, status=2)
    assert file.read_text(encoding="utf-8") == "mine"
    run("model", "copy", "sculler", file, "--force")
    assert file.read_text(encoding="utf-8") != "mine"


# --- recording to report ------------------------------------------------------------------------------


def test_simulate_writes_recording_and_truth_and_keeps_what_is_there(trial):
    assert (trial / "trial" / "recording.toml").is_file()
    assert (trial / "trial" / "truth" / "run.toml").is_file()
    refused = run("simulate", "--out", trial / "trial", "--duration-s", 3, status=2)
    assert "--force" in refused.stderr


def test_track_writes_its_folder(trial):
    names = ("track.parquet", "sensors.parquet", "run.toml", "report.html", "track.csv", "sensors.csv")
    assert [name for name in names if not (trial / "out" / name).is_file()] == []


def test_track_json_is_one_document(trial, tmp_path):
    tracked = run("track", trial / "trial", "--model", "sculler", "--out", tmp_path / "out", "--json")
    document = json.loads(tracked.stdout)
    assert document["samples"] > 300
    assert document["sensors"]["back"]["used"] > 0
    assert "r_oar_theta" in document["not_observed"]


def test_track_takes_a_filter_and_writes_it_down(trial, tmp_path):
    run("track", trial / "trial", "--model", "sculler", "--out", tmp_path / "out", "--filter", "ekf")
    written = tomllib.loads((tmp_path / "out" / "run.toml").read_text(encoding="utf-8"))
    assert written["provenance"]["config"]["filter"] == "ekf"


def test_track_does_not_write_into_a_recording(trial):
    into = ("--out", trial / "trial", "--force")
    shown = run("track", trial / "trial", "--model", "sculler", *into, status=2).stderr
    assert "is a recording; choose another folder" in " ".join(shown.split())


def test_evaluate_prints_a_table_and_json(trial):
    shown = run("evaluate", trial / "out", trial / "trial", "--start-s", 1)
    assert "r_elbow_flexion" in shown.stdout
    assert max(map(len, shown.stdout.splitlines())) <= terminal.WIDTH
    document = json.loads(run("evaluate", trial / "out", trial / "trial" / "truth", "--json").stdout)
    assert document["joints"]["trunk"]["rmse_rad"] < 0.01


def test_report_is_written_where_it_is_asked_for(trial, tmp_path):
    file = tmp_path / "a.html"
    run("report", trial / "out", "--truth", trial / "trial", "--out", file)
    assert "<html" in file.read_text(encoding="utf-8")


# --- settings of the filter ---------------------------------------------------------------------------


def test_help_names_every_setting_with_its_default():
    with_flags = {"filter", "output_rate_hz"}
    named = {key.partition(".")[0] for key in settings.MEANINGS}
    assert named | with_flags == set(oarlock.Config().to_dict())
    shown = run("track", "--help").stdout
    assert "gate_patience_s=0.05 " in shown and "closures=true " in shown
    assert "estimate=gyro_bias,accel_bias,surge " in shown


def test_a_setting_overrides_the_file_that_overrides_the_default(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'alpha = 0.5\nbeta = 1\nestimate = ["gyro_bias"]\noutput_rate_hz = "none"\n', encoding="utf-8"
    )
    model = oarlock.load_model("sculler")
    texts = ["l_ua_r=0.31", "alpha=0.4", "gate=false", "initial_q.seat=0.1"]
    parameters, chosen = settings.split(texts, model.parameters)
    config = settings.configuration(model, {**settings.settings_of_file(file), **chosen}).to_dict()
    assert parameters == {"l_ua_r": 0.31}
    assert (config["alpha"], config["beta"], config["gate"]) == (0.4, 1.0, False)
    assert config["estimate"] == ["gyro_bias"] and config["output_rate_hz"] is None
    assert config["initial_q"][model.describe().joints.index(joint_named(model, "seat"))] == 0.1


def joint_named(model: oarlock.Model, name: str) -> dict[str, object]:
    return next(joint for joint in model.describe().joints if joint.name == name)


def test_a_parameter_of_the_model_takes_precedence_over_a_setting():
    assert settings.split(["alpha=0.2"], {"alpha"}) == ({"alpha": 0.2}, {})
    assert settings.split(["alpha=0.2", "estimate=none"], set()) == ({}, {"alpha": 0.2, "estimate": ()})


def test_an_earlier_run_gives_its_settings(trial):
    found = settings.settings_of_file(trial / "out" / "run.toml")
    assert found == oarlock.load_track(trial / "out").provenance["config"]
    model = oarlock.load_model("sculler")
    again = settings.configuration(model, found).to_dict()
    by_itself = {"sample_rate_hz", "output_rate_hz", "inputs", "stamp_std_s"}
    assert {
        key: value for key, value in oarlock.Config().to_dict().items() if again[key] != value
    }.keys() == by_itself


# --- errors -------------------------------------------------------------------------------------------


TRACK = ("track", "nowhere", "--model", "sculler")
OUT = ("--out", "unused")


@pytest.mark.parametrize(
    ("status", "arguments"),
    [
        (1, ("model", "show", "scular")),
        (1, (*TRACK, *OUT)),
        (1, ("evaluate", "nowhere", "nowhere")),
        (1, ("report", "nowhere")),
        (1, ("import", "apdm", "nowhere.csv", *OUT)),
        (1, ("import", "csv", "nowhere.toml", *OUT)),
        (2, TRACK),
        (2, (*TRACK, *OUT, "--set", "l_ua_r")),
        (2, (*TRACK, *OUT, "--set", "l_ua_r=long")),
        (2, (*TRACK, *OUT, "--set", "process_noise=pink")),
        (2, (*TRACK, *OUT, "--set", "gate=false", "--set", "gate=true")),
        (2, (*TRACK, *OUT, "--set", "initial_q.knee=0.1")),
        (1, (*TRACK, *OUT, "--config", "nowhere.toml")),
        (2, (*TRACK, *OUT, "--filter", "kalman")),
        (2, ("simulate", *OUT, "--condition", "Q-Q")),
        (2, ("simulate", *OUT, "--rate-spm", "fast")),
        (2, ("model", "copy", "scular", "unused.toml")),
        (2, ("row",)),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else str(value),
)
def test_an_error_is_a_short_text_on_stderr(status, arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused = run(*arguments, status=status)
    assert refused.stdout == ""
    assert "rror" in refused.stderr
    assert "Traceback" not in refused.stderr
    assert list(tmp_path.iterdir()) == []


def test_with_json_an_error_is_a_document_too(tmp_path):
    refused = run(
        "track", tmp_path / "nowhere", "--model", "sculler", "--out", tmp_path / "out", "--json", status=1
    )
    assert "nowhere" in json.loads(refused.stdout)["error"]["message"]
    assert "nowhere" in refused.stderr


def test_a_fault_of_our_own_is_told_from_a_fault_of_the_data(capsys):
    @terminal.verb
    def broken() -> None:
        raise IndexError("index 7 is out of bounds")

    with pytest.raises(BaseException) as leaving:
        broken()
    assert getattr(leaving.value, "exit_code", None) == 1
    text = capsys.readouterr().err
    assert "fault in oarlock itself" in text and "index 7" in text
    assert "Traceback" not in text


def test_json_has_no_nan():
    assert terminal.json_ready({"a": float("nan"), "b": (float("inf"), 1.5)}) == {"a": None, "b": [None, 1.5]}


def typed_with(before):
    code = f"import faulthandler, sys\nfrom oarlock import cli\n{before}\ncli.main()"
    return subprocess.run([sys.executable, "-c", code, "--version"], capture_output=True, text=True)


def test_a_crash_of_compiled_code_says_where_it_was():
    done = typed_with("cli.app = lambda **_: faulthandler._sigabrt()")
    assert done.returncode == -signal.SIGABRT and "Fatal Python error: Aborted" in done.stderr


def test_a_program_without_stderr_has_verbs_too():
    done = typed_with("sys.stderr = None")
    assert done.returncode == 0 and done.stdout.startswith("oarlock ")
