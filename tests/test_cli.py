"""The command line: help, exit status, one JSON document, errors as one block on stderr."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import oarlock
from oarlock.cli import app, settings, terminal

VERBS = (
    ("bench",),
    ("demo",),
    ("simulate",),
    ("strokes",),
    ("track",),
    ("evaluate",),
    ("compare",),
    ("report",),
    ("export",),
    ("import", "apdm"),
    ("import", "csv"),
    ("calibrate", "chain"),
    ("calibrate", "session"),
    ("model", "list"),
    ("model", "show"),
    ("model", "check"),
    ("model", "copy"),
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


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="oarlock")


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of three seconds with its truth, and what `track` made of it."""
    folder = tmp_path_factory.mktemp("cli")
    assert run("simulate", "--out", folder / "trial", "--duration-s", 3).exit_code == 0
    tracked = run("track", folder / "trial", "--model", "sculler", "--out", folder / "out", "--csv")
    assert tracked.exit_code == 0, tracked.output
    return folder


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_help_says_what_it_does_and_gives_examples(verb: tuple[str, ...]) -> None:
    shown = run(*verb, "--help")
    assert shown.exit_code == 0
    assert f"Usage: oarlock {' '.join(verb)}" in shown.stdout
    examples = shown.stdout.partition("Examples:")[2]
    assert f"oarlock {' '.join(verb)}" in examples


def test_version() -> None:
    shown = run("--version")
    assert shown.exit_code == 0
    assert shown.stdout.startswith("oarlock ")


def test_without_a_verb_the_help_is_shown() -> None:
    assert "model" in run().output


# --- model --------------------------------------------------------------------------------------------


def test_model_list_names_the_shipped_models() -> None:
    listed = {entry["name"] for entry in json.loads(run("model", "list", "--json").stdout)}
    assert {"sculler", "pendulum3"} <= listed


def test_model_show_holds_every_part_within_100_columns() -> None:
    shown = run("model", "show", "sculler")
    assert shown.exit_code == 0, shown.output
    parts = ("Parameters", "Joints", "Frames", "Sensors", "Closures", "State", "Measurement", "Pose")
    headings = [line.split("  ")[0] for line in shown.stdout.splitlines()]
    assert [part for part in parts if part not in headings] == []
    assert max(map(len, shown.stdout.splitlines())) <= terminal.WIDTH
    assert "\x1b" not in shown.stdout
    assert not any(line != line.rstrip() for line in shown.stdout.splitlines())


def test_model_show_json_lists_the_measurement_rows() -> None:
    description = json.loads(run("model", "show", "sculler", "--json").stdout)
    assert len(description["measurement_names"]) == 58
    assert len(description["frames"]) == 26
    assert description["joints"][0]["name"] == "seat"


def test_model_show_writes_svg_and_takes_a_pose(tmp_path: Path) -> None:
    at_rest, leaning = tmp_path / "rest.svg", tmp_path / "lean.svg"
    assert run("model", "show", "sculler", "--svg", at_rest).exit_code == 0
    assert run("model", "show", "sculler", "--svg", leaning, "--at", "trunk=-0.4").exit_code == 0
    assert at_rest.read_text().startswith("<svg")
    assert at_rest.read_text() != leaning.read_text()


def test_an_unknown_joint_in_a_pose_is_a_usage_error_with_the_nearest_name() -> None:
    refused = run("model", "show", "sculler", "--at", "trnk=0")
    assert refused.exit_code == 2
    assert "trunk" in refused.stderr


def test_model_check_accepts_what_is_shipped() -> None:
    checked = run("model", "check", "sculler")
    assert checked.exit_code == 0, checked.output
    assert "58 rows" in checked.stdout


def test_model_check_explains_a_broken_file(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text(BROKEN_MODEL)
    checked = run("model", "check", file)
    assert checked.exit_code == 1
    assert checked.stdout == ""
    assert "limts" in checked.stderr and "limits" in checked.stderr
    assert "Traceback" not in checked.stderr
    document = json.loads(run("model", "check", file, "--json").stdout)
    assert document["ok"] is False
    assert any("limts" in mistake for mistake in document["mistakes"])


def test_model_copy_is_a_fine_model_and_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    copied = run("model", "copy", "sculler", file)
    assert copied.exit_code == 0
    # Wherever the terminal has broken the line.
    assert f"oarlockmodelcheck{file}" in "".join(copied.stdout.split())
    assert run("model", "check", file).exit_code == 0
    file.write_text("mine")
    assert run("model", "copy", "sculler", file).exit_code == 2
    assert file.read_text() == "mine"
    assert run("model", "copy", "sculler", file, "--force").exit_code == 0
    assert file.read_text() != "mine"


# --- recording to report ------------------------------------------------------------------------------


def test_simulate_writes_recording_and_truth_and_keeps_what_is_there(trial: Path) -> None:
    assert (trial / "trial" / "recording.toml").is_file()
    assert (trial / "trial" / "truth" / "run.toml").is_file()
    refused = run("simulate", "--out", trial / "trial", "--duration-s", 3)
    assert refused.exit_code == 2
    assert "--force" in refused.stderr


def test_track_writes_its_folder(trial: Path) -> None:
    names = ("track.parquet", "sensors.parquet", "run.toml", "report.html", "track.csv", "sensors.csv")
    assert [name for name in names if not (trial / "out" / name).is_file()] == []


def test_track_json_is_one_document(trial: Path, tmp_path: Path) -> None:
    tracked = run("track", trial / "trial", "--model", "sculler", "--out", tmp_path / "out", "--json")
    document = json.loads(tracked.stdout)
    assert document["samples"] > 300
    assert document["sensors"]["back"]["used"] > 0
    assert "r_oar_theta" in document["not_observed"]


def test_track_takes_a_filter_and_writes_it_down(trial: Path, tmp_path: Path) -> None:
    tracked = run(
        "track", trial / "trial", "--model", "sculler", "--out", tmp_path / "out", "--filter", "ekf"
    )
    assert tracked.exit_code == 0, tracked.output
    assert (
        tomllib.loads((tmp_path / "out" / "run.toml").read_text())["provenance"]["config"]["filter"] == "ekf"
    )


def test_track_does_not_write_into_a_recording(trial: Path) -> None:
    refused = run("track", trial / "trial", "--model", "sculler", "--out", trial / "trial", "--force")
    assert refused.exit_code == 2


def test_evaluate_prints_a_table_and_json(trial: Path) -> None:
    shown = run("evaluate", trial / "out", trial / "trial", "--start-s", 1)
    assert shown.exit_code == 0, shown.output
    assert "r_elbow_flexion" in shown.stdout
    assert max(map(len, shown.stdout.splitlines())) <= terminal.WIDTH
    document = json.loads(run("evaluate", trial / "out", trial / "trial" / "truth", "--json").stdout)
    assert document["joints"]["trunk"]["rmse_rad"] < 0.01


def test_report_is_written_where_it_is_asked_for(trial: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.html"
    assert run("report", trial / "out", "--truth", trial / "trial", "--to", file).exit_code == 0
    assert "<html" in file.read_text()


# --- settings of the filter ---------------------------------------------------------------------------


def test_help_names_every_setting_with_its_default() -> None:
    with_flags = {"filter", "output_rate_hz"}
    named = {key.partition(".")[0] for key in settings.MEANINGS}
    assert named | with_flags == set(oarlock.Config().to_dict())
    shown = run("track", "--help").stdout
    assert "gate_patience_s=0.05 " in shown and "closures=true " in shown
    assert "estimate=gyro_bias,accel_bias,surge " in shown


def test_a_setting_overrides_the_file_that_overrides_the_default(tmp_path: Path) -> None:
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
    assert config["initial_q"][model.describe()["joints"].index(joint_named(model, "seat"))] == 0.1


def joint_named(model: oarlock.Model, name: str) -> dict[str, object]:
    return next(joint for joint in model.describe()["joints"] if joint["name"] == name)


def test_a_parameter_of_the_model_takes_precedence_over_a_setting() -> None:
    assert settings.split(["alpha=0.2"], {"alpha"}) == ({"alpha": 0.2}, {})
    assert settings.split(["alpha=0.2", "estimate=none"], set()) == ({}, {"alpha": 0.2, "estimate": ()})


def test_an_earlier_run_gives_its_settings(trial: Path) -> None:
    found = settings.settings_of_file(trial / "out" / "run.toml")
    assert found == oarlock.load_track(trial / "out").provenance["config"]
    model = oarlock.load_model("sculler")
    assert settings.configuration(model, found) == oarlock.Config()


@pytest.mark.parametrize("flag", settings.NOW_SETTINGS)
def test_a_flag_that_became_a_setting_says_so(flag: str) -> None:
    refused = run("track", "nowhere", "--model", "sculler", flag, "--out", "unused")
    assert refused.exit_code == 2
    assert f"{flag} is a setting now: {settings.NOW_SETTINGS[flag]}" in " ".join(refused.stderr.split())


# --- errors -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("status", "arguments"),
    [
        (1, ("model", "show", "scular")),
        (1, ("track", "nowhere", "--model", "sculler", "--out", "unused")),
        (1, ("evaluate", "nowhere", "nowhere")),
        (1, ("report", "nowhere")),
        (1, ("import", "apdm", "nowhere.csv", "--out", "unused")),
        (1, ("import", "csv", "nowhere.toml", "--out", "unused")),
        (2, ("track", "nowhere", "--model", "sculler")),
        (2, ("track", "nowhere", "--model", "sculler", "--out", "unused", "--set", "l_ua_r")),
        (2, ("track", "nowhere", "--model", "sculler", "--out", "unused", "--set", "l_ua_r=long")),
        (2, ("track", "nowhere", "--model", "sculler", "--out", "unused", "--set", "process_noise=pink")),
        (
            2,
            (
                "track",
                "nowhere",
                "--model",
                "sculler",
                "--out",
                "unused",
                "--set",
                "gate=false",
                "--set",
                "gate=true",
            ),
        ),
        (2, ("track", "nowhere", "--model", "sculler", "--out", "unused", "--set", "initial_q.knee=0.1")),
        (1, ("track", "nowhere", "--model", "sculler", "--out", "unused", "--config", "nowhere.toml")),
        (2, ("track", "nowhere", "--model", "sculler", "--out", "unused", "--filter", "kalman")),
        (2, ("simulate", "--out", "unused", "--condition", "Q-Q")),
        (2, ("simulate", "--out", "unused", "--rate-spm", "fast")),
        (2, ("model", "copy", "scular", "unused.toml")),
        (2, ("row",)),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else str(value),
)
def test_an_error_is_a_short_text_on_stderr(
    status: int, arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    refused = run(*arguments)
    assert refused.exit_code == status, refused.output
    assert refused.stdout == ""
    assert "rror" in refused.stderr
    assert "Traceback" not in refused.stderr
    assert list(tmp_path.iterdir()) == []


def test_with_json_an_error_is_a_document_too(tmp_path: Path) -> None:
    refused = run("track", tmp_path / "nowhere", "--model", "sculler", "--out", tmp_path / "out", "--json")
    assert refused.exit_code == 1
    assert "nowhere" in json.loads(refused.stdout)["error"]["message"]
    assert "nowhere" in refused.stderr


def test_a_fault_of_our_own_is_told_from_a_fault_of_the_data(capsys: pytest.CaptureFixture[str]) -> None:
    @terminal.verb
    def broken() -> None:
        raise IndexError("index 7 is out of bounds")

    with pytest.raises(BaseException) as leaving:
        broken()
    assert getattr(leaving.value, "exit_code", None) == 1
    text = capsys.readouterr().err
    assert "fault in oarlock itself" in text and "index 7" in text
    assert "Traceback" not in text


def test_json_has_no_nan() -> None:
    assert terminal.json_ready({"a": float("nan"), "b": (float("inf"), 1.5)}) == {"a": None, "b": [None, 1.5]}
