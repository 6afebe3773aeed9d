"""Every verb runs from beginning to end in `make test`: here, or in the test that is named here."""

import importlib
import inspect
import json
from typing import Any

import pytest
import typer

import oarlock
from command_line import run
from exact_recording import at_rate, load_excerpt
from oarlock.cli import app, load_verb

LEAF = {
    "calibrate units": "test_assign.test_units_of_any_name_get_their_sensors",
    "lab bench": "test_bench.test_text_names_the_filters_and_the_paper",
    "calibrate axes": "test_calibrate_tree.test_commands",
    "calibrate chain": "test_pendulum.test_the_commands_of_the_page_lead_from_the_file_to_angles",
    "calibrate clocks": "test_clocks.test_the_verb_writes_a_calibration_and_says_whose_clock_is_late",
    "calibrate field": "test_calibrate_tree.test_commands",
    "calibrate joints": "test_calibrate_tree.test_commands",
    "calibrate motion": "test_every_verb.test_calibrate_motion",
    "calibrate pose": "test_calibrate_tree.test_commands",
    "calibrate sagittal": "test_run.test_mounts_from_a_walk",
    "calibrate session": "test_session_cli.test_a_session_becomes_a_calibration_and_a_page",
    "calibrate stature": "test_every_verb.test_calibrate_stature",
    "lab compare": "test_compare.test_the_verb_speaks_json_and_leaves_the_page_out",
    "rowing crew": "test_crew.test_the_verb_writes_the_page_and_json",
    "demo": "test_every_verb.test_demo",
    "lab emulate": "test_emulate_cli.test_a_kind_is_emulated_and_its_rig_written",
    "evaluate": "test_cli.test_evaluate_prints_a_table_and_json",
    "export": "test_export.test_typed",
    "import PATH": "test_import_path.test_one_recording_is_written_and_described",
    "import apdm": "test_pendulum.test_the_commands_of_the_page_lead_from_the_file_to_angles",
    "import broad": "test_io_validation.test_the_command_line_imports_each",
    "import c3d": "test_device_verbs.test_the_command_line_imports_each",
    "import csv": "test_packets.test_import_reports_missing_packets",
    "import dfjimu": "test_io_validation.test_the_command_line_imports_each",
    "import diodem": "test_io_validation.test_the_command_line_imports_each",
    "import dot": "test_io_devices.test_the_command_line_imports_each",
    "import lines": "test_device_verbs.test_the_command_line_imports_each",
    "import mcap": "test_device_verbs.test_the_command_line_imports_each",
    "import mtmanager": "test_io_devices.test_the_command_line_imports_each",
    "import mvnx": "test_io_devices.test_the_command_line_imports_each",
    "import ngimu": "test_device_verbs.test_the_command_line_imports_each",
    "import openaxes": "test_io_validation.test_the_command_line_imports_each",
    "import qmt": "test_io_validation.test_the_command_line_imports_each",
    "import shimmer": "test_io_devices.test_the_command_line_imports_each",
    "import sto": "test_io_devices.test_the_command_line_imports_each",
    "import table": "test_import_path.test_a_format_in_front_reads_it_as_that",
    "import xdf": "test_device_verbs.test_the_command_line_imports_each",
    "import ximu3": "test_device_verbs.test_the_command_line_imports_each",
    "markers attach": "test_markers_cli.test_attach_places_markers_by_a_static_trial",
    "markers show": "test_markers_cli.test_show_tells_what_is_in_a_file",
    "markers simulate": "test_markers_cli.test_a_session_becomes_a_study_that_is_tracked_and_scored",
    "model check": "test_cli.test_model_check_accepts_what_is_shipped",
    "model copy": "test_cli.test_model_copy_is_a_fine_model_and_is_not_overwritten",
    "model list": "test_cli.test_model_list_names_the_shipped_models",
    "model show": "test_cli.test_model_show_json_lists_the_measurement_rows",
    "live demo": "test_live_cli.test_the_demo_tracks_emulated_sensors",
    "live doctor": "test_doctor.test_without_a_rig_it_looks_at_this_machine",
    "live init": "test_rig_from_scan.test_nothing_heard_gives_a_file_that_says_what_to_write",
    "live recover": "test_live_cli.test_a_rig_is_recorded_and_the_recording_written_again",
    "live scan": "test_scan.test_nothing_is_said_to_be_nothing",
    "live track": "test_live_track.test_a_session_becomes_a_track_that_other_verbs_read",
    "live run": "test_live_cli.test_a_rig_is_recorded_and_the_recording_written_again",
    "season run": "test_season_run.test_typed",
    "season setup": "test_season_run.test_typed",
    "report": "test_cli.test_report_is_written_where_it_is_asked_for",
    "season erase": "test_season_erase.test_the_command",
    "season export": "test_season_privacy.test_an_export_has_everything_of_one_athlete_and_nothing_of_others",
    "lab reproduce": "test_reproduce.test_the_verb_writes_a_page_and_tables",
    "run": "test_run.test_from_files_to_a_report",
    "season add": "test_season_store.test_the_verbs_answer",
    "season athlete": "test_season_store.test_the_verbs_answer",
    "season check": "test_season_store.test_the_verbs_answer",
    "season init": "test_season_store.test_the_verbs_answer",
    "season list": "test_season_store.test_the_verbs_answer",
    "season prune": "test_season_store.test_the_verbs_answer",
    "season page": "test_season_page.test_the_command",
    "season query": "test_season_questions.test_the_verbs_answer",
    "season questions": "test_season_questions.test_the_verbs_answer",
    "lab season": "test_season_questions.test_the_verbs_answer",
    "season trend": "test_season_questions.test_the_verbs_answer",
    "simulate": "test_cli.test_simulate_writes_recording_and_truth_and_keeps_what_is_there",
    "rowing strokes": "test_stroke_exports.test_command_shows_and_writes",
    "lab study": "test_study.test_the_verb_writes_tables_and_a_page_that_needs_nothing",
    "track": "test_cli.test_track_json_is_one_document",
    "calibrate video": "test_video.test_the_verb_finds_a_drawn_video_within_a_frame",
    "calibrate clap": "test_video.test_the_verb_aligns_by_a_clap",
    "view": "test_viewer_cli.test_it_opens_nothing_when_told_so",
}
# In these the words of a verb stand in the page or the fixture that the test reads, or a file stands for PATH.
SAID_ELSEWHERE = {"import PATH", "markers simulate", "simulate"}


def leaves(command: Any, words: tuple[str, ...]) -> list[str]:
    if not hasattr(command, "commands"):
        return [" ".join(words)]
    return [leaf for name, verb in command.commands.items() for leaf in leaves(verb, (*words, name))]


def app_verb(leaf: str) -> Any:
    """The command of some words, such as `calibrate axes`; `import PATH` is that of `import` itself."""
    first, *rest = leaf.split()
    command = load_verb(first)
    for word in rest:
        command = command.commands[word]
    return command


ALL = [leaf for name in typer.main.get_group(app).commands for leaf in leaves(load_verb(name), (name,))]


@pytest.mark.parametrize("verb", ALL)
def test_it_is_run_by_a_test_of_every_change(verb):
    assert verb in LEAF, f"`oarlock {verb}`: run it once in a quick test and name that here"
    file, name = LEAF[verb].split(".")
    test = getattr(importlib.import_module(file), name)
    marks = [*getattr(test, "pytestmark", ()), *marks_of(file)]
    assert "long" not in {mark.name for mark in marks}
    source = inspect.getsource(test)
    assert verb in SAID_ELSEWHERE or all(f'"{word}"' in source for word in verb.split())


def marks_of(file: str) -> list[pytest.Mark]:
    marks = getattr(importlib.import_module(file), "pytestmark", [])
    return [mark.mark for mark in (marks if isinstance(marks, list) else [marks])]


def test_demo(tmp_path, monkeypatch):
    monkeypatch.setattr("oarlock.cli.demo.DURATION_S", 12.0)
    out = tmp_path / "demo"
    assert json.loads(run("demo", "--out", out, "--json").stdout)
    assert list(out.rglob("report.html"))


def test_calibrate_motion(tmp_path):
    at_rate(load_excerpt().recording, 20.0).save(tmp_path / "rec")
    out = tmp_path / "cal.toml"
    shown = run("calibrate", "motion", tmp_path / "rec", "--model", "sculler", "--out", out)
    assert "oarlock track" in shown.stdout
    assert oarlock.load_calibration(out).noted["scores"]


def test_calibrate_stature(tmp_path):
    out = tmp_path / "stature.toml"
    run("calibrate", "stature", "1.84", "--model", "sculler", "--out", out)
    assert oarlock.load_calibration(out).parameters["l_ua_r"] == pytest.approx(0.186 * 1.84)
