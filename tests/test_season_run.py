"""What a season lacks is computed once, and a recording that fails, ends or hangs its process is named."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

import season_bad_jobs as jobs
import season_support as support
from command_line import run as typed
from exact_recording import at_rate, load_excerpt, sculler
from oarlock import Calibration, Config, DataError, load_model
from oarlock.season import Admission, Season, Setup, create_season, open_season
from oarlock.season.compute import (
    StrokesAndHealth,
    choose_setup,
    commit,
    failed_record,
    make_setup,
    opened_setup,
    run_job,
)
from oarlock.season.erase import erase
from oarlock.season.processes import Child, Processes
from oarlock.season.records import ENTRY_FILE, Entry
from oarlock.season.run import LIMIT_S, LIMIT_SHARE, Ended, Job, Reply, RunCounts, make_plan, run_season
from oarlock.season.tables import catalogue, update_tables
from oarlock.season.upkeep import check

LATE_S = 120.0
"""What is waited for comes within seconds; a busy machine takes longer."""


class Here:
    """An executor that computes in this process, one job after the other."""

    def __init__(self, task: Callable[[Job], Reply]) -> None:
        self.task = task
        self.began: list[Job] = []
        self.is_cancelled = False

    def run(self, jobs: Sequence[Job]) -> Iterator[Ended]:
        for job in jobs:
            self.began.append(job)
            yield Ended(job, self.task(job), "here", 1, 0.5)

    def cancel(self) -> None:
        self.is_cancelled = True


@pytest.fixture
def season(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Season:
    """With four recordings of two athletes, and a count of what is computed."""
    monkeypatch.setenv(jobs.COUNT, str(tmp_path / "count"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA", "BBBBBB")
    for seed in range(4):
        support.add_noise(season, "AAAAAA" if seed % 2 else "BBBBBB", seed)
    return choose_setup(season, make_setup(sculler()))


def bad(monkeypatch: pytest.MonkeyPatch, **what: str) -> None:
    """What recordings do, by name; a name begins with an underscore if it is a digit."""
    monkeypatch.setenv(jobs.BAD, json.dumps({name.lstrip("_"): how for name, how in what.items()}))


def done(season: Season, task: Callable[[Job], Reply] = jobs.quick_task, **plan: object) -> RunCounts:
    return run_season(season, Here(task), make_plan(season, **plan))  # type: ignore[arg-type]


def left(season: Season) -> int:
    return len(make_plan(season).jobs)


def test_what_is_missing_is_computed_and_nothing_else(season: Season, tmp_path: Path) -> None:
    assert done(season).computed == 4
    assert (left(season), make_plan(season).there) == (0, 4)
    support.add_noise(season, "AAAAAA", 9)
    assert done(season).computed == 1
    assert set(jobs.begun(tmp_path / "count").values()) == {1}
    assert check(season) == []


def test_another_setup_makes_it_out_of_date_for_whom_it_is(season: Season) -> None:
    done(season)
    longer = make_setup(sculler(), Calibration(parameters={"l_ua_r": 0.33}))
    changed = choose_setup(season, longer, "AAAAAA")
    assert left(changed) == 2
    assert done(changed).computed == 2
    runs = {record.setup for record in catalogue(changed).current().values()}
    assert runs == {changed.setup, longer.name}
    assert len(catalogue(changed).records) == 6
    choose_setup(changed, make_setup(sculler()), "AAAAAA")
    assert left(open_season(season.place.address)) == 0


def test_a_setup_has_everything_and_one_name_however_it_is_written(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text('extends = "sculler"\n')
    calibration = Calibration(parameters={"l_ua_r": 0.31}, noted={"by": "somebody"})
    setup = make_setup(load_model(own), calibration, Config(filter="ekf", gate=False))
    model, wearing, config = opened_setup(setup)
    assert b"extends" not in setup.model
    assert model.frame_names == sculler().frame_names
    assert wearing is not None
    assert (dict(wearing.parameters), dict(wearing.noted)) == ({"l_ua_r": 0.31}, {})
    assert config.to_dict() == Config(filter="ekf", gate=False).to_dict()
    assert make_setup(load_model(own), calibration, Config(gate=False, filter="ekf")) == setup
    with pytest.raises(DataError, match="has no frame seat"):
        make_setup(load_model("lower_body"))
    with pytest.raises(DataError, match="give them in a calibration"):
        make_setup(load_model("sculler", parameters={"l_ua_r": 0.33}))


def test_without_a_setup_only_exports_are_computed(tmp_path: Path) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA")
    support.add_noise(season, "AAAAAA", 1)
    export = Path(__file__).parents[1] / "examples/strokes/rp3.csv"
    name = Admission(season, "AAAAAA").add(export, {"date": "2026-05-01"}).entry.recording
    plan = make_plan(season)
    assert [job.recording for job in plan.jobs] == [name]
    assert len(plan.without_setup) == 1
    assert run_season(season, Here(run_job), plan).computed == 1
    record = catalogue(season).current()[name]
    assert record.strokes > 5
    contents = season.place.read(f"athlete=AAAAAA/results/{name}.{record.run}/strokes.parquet")
    assert str(tmp_path).encode() not in contents


def test_the_longest_goes_first_and_has_most_time(season: Season) -> None:
    long = Admission(season, "AAAAAA").add_recording(support.noise(50, seconds=8.0), {}).entry
    plan = make_plan(season)
    assert plan.jobs[0].recording == long.recording
    assert plan.jobs[0].limit_s == pytest.approx(LIMIT_S + LIMIT_SHARE * 7.98)
    assert {job.limit_s for job in make_plan(season, limit_s=9.0).jobs} == {9.0}


def test_what_failed_is_repeated_only_on_request(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two, *_ = season.recordings()
    folder = f"athlete={season.recordings()[two]}/recordings/{two}"
    damaged = Path(season.place.address, folder, "trunk.parquet")
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[:-1] + b"x")
    bad(monkeypatch, **{one: "raise"})
    found = done(season)
    assert found.failed == {
        one: "ZeroDivisionError: nothing to divide by",
        two: f"{folder}/trunk.parquet: is damaged: its SHA-256 differs from the recorded one; "
        "restore it from a backup, then run with --again-failed",
    }
    assert make_plan(season).failed == found.failed
    assert left(season) == 0
    damaged.write_bytes(whole)
    bad(monkeypatch)
    assert done(season, again=True).computed == 2
    assert (make_plan(season).failed, make_plan(season, again=True).jobs) == ({}, [])


def test_a_recording_whose_process_ends_is_tried_once_more_alone_and_then_blamed(season: Season) -> None:
    guilty, unlucky, *_ = season.recordings()
    lost: list[str] = []

    def task(job: Job) -> Reply:
        if job.recording == guilty or (job.recording == unlucky and unlucky not in lost):
            lost.append(job.recording)
            return Reply("lost", "its process was ended by SIGSEGV", detail="Segmentation fault")
        return jobs.quick_task(job)

    here = Here(task)
    found = run_season(season, here, make_plan(season))
    assert (found.computed, list(found.failed)) == (3, [guilty])
    assert "again when it was computed alone: its process was ended by SIGSEGV" in found.failed[guilty]
    assert {job.recording for job in here.began[4:]} == {guilty, unlucky}
    assert [job.alone for job in here.began] == [False] * 4 + [True] * 2
    files = [found.log, *(f"athlete={name}/{found.log}" for name in season.athletes())]
    log = [json.loads(line) for file in files for line in season.place.read(file).decode().splitlines()]
    assert [line["event"] for line in log[:2]] == ["begun", "finished"]
    assert [line["event"] for line in log].count("lost") == 3
    assert {line["detail"] for line in log if line["event"] == "lost"} == {"Segmentation fault"}


def test_a_hanging_recording_is_blamed_at_once(season: Season) -> None:
    guilty, *_ = season.recordings()
    hangs = Reply("hung", "it was not done after 9 s")
    here = Here(lambda job: hangs if job.recording == guilty else jobs.quick_task(job))
    found = run_season(season, here, make_plan(season))
    assert found.failed[guilty].startswith("hangs: it was not done after 9 s; a longer --task-limit-s")
    assert len(here.began) == 4


def test_what_no_recording_is_to_blame_for_ends_the_run_and_the_next_continues(season: Season) -> None:
    plan = make_plan(season)
    first = plan.jobs[1].recording
    full = Reply("refused", "no space left on device")
    here = Here(lambda job: full if job.recording == first else jobs.quick_task(job))
    with pytest.raises(DataError, match=r"no space left on device\. All finished results are stored"):
        run_season(season, here, plan)
    assert here.is_cancelled
    (log,) = (name for name, _ in season.place.files("logs"))
    assert b"stopped" in season.place.read(log)
    assert not any(name.encode() in season.place.read(log) for name in season.athletes())
    assert done(season).computed == 3


def test_what_is_added_meanwhile_is_computed_too(season: Season) -> None:
    def task(job: Job) -> Reply:
        if len(season.recordings()) < 6:
            support.add_noise(season, "AAAAAA", 90 + len(season.recordings()))
        return jobs.quick_task(job)

    found = run_season(season, Here(task), make_plan(season), look_again=lambda: make_plan(season))
    assert found.computed == 6


def test_what_another_run_stored_is_not_computed_again(season: Season, tmp_path: Path) -> None:
    plan = make_plan(season)
    done(season)
    found = run_season(season, Here(jobs.quick_task), plan)
    assert (found.computed, found.there) == (0, 4)
    assert set(jobs.begun(tmp_path / "count").values()) == {1}


def test_other_versions_are_refused(season: Season) -> None:
    job = make_plan(season).jobs[0]
    reply = run_job(replace(job, versions=(("oarlock", "9.9"),)))
    assert reply.status == "refused"
    assert "this command 9.9" in reply.words


def test_raw_data_that_retention_removed_are_left_alone(season: Season) -> None:
    (one, athlete), *_ = season.recordings().items()
    entry = season.entry(athlete, one)
    assert entry is not None
    season.place.write(f"{entry.folder}/{ENTRY_FILE}", replace(entry, files={}).toml())
    plan = make_plan(season)
    assert (len(plan.jobs), plan.removed) == (3, 1)


def test_a_recording_without_strokes_is_done_and_has_no_rows(season: Season) -> None:
    reply = run_job(make_plan(season).jobs[0], lambda season, entry, setup: (None, {"trunk.nis": 1.0}))
    assert reply.status == "done"
    record = catalogue(season).records[0]
    assert (record.status, record.strokes, dict(record.files)) == ("done", 0, {})
    assert len(update_tables(season).entries) == 4
    assert check(season) == []


def test_an_erasure_meanwhile_leaves_no_result(season: Season) -> None:
    job = make_plan(season).jobs[0]

    def erasing(season: Season, entry: Entry, setup: Setup) -> StrokesAndHealth:
        assert erase(season, entry.athlete, dry_run=False).is_proven
        return None, {}

    assert run_job(job, erasing).status == "there"
    assert season.results_of(job.athlete) == []
    assert job.athlete not in season.folders()


def test_a_failure_gives_way_to_a_result_and_never_the_reverse(season: Season) -> None:
    job = make_plan(season).jobs[0]
    setup = season.load_setup(job.setup, job.athlete)
    assert commit(season, job, failed_record(job, setup, "first"), {}, setup)
    assert not commit(season, job, failed_record(job, setup, "second"), {}, setup)
    assert commit(season, replace(job, again=True), failed_record(job, setup, "third"), {}, setup)
    assert [record.fault for record in catalogue(season).records] == ["third"]
    result = replace(failed_record(job, setup, ""), status="done")
    assert commit(season, job, result, {}, setup)
    assert not commit(season, replace(job, again=True), failed_record(job, setup, "late"), {}, setup)
    Path(
        season.place.address, f"athlete={job.athlete}/results/{job.recording}.{job.run}/run.toml"
    ).write_bytes(b"\xff")
    assert commit(season, job, result, {}, setup)
    assert [record.status for record in catalogue(season).records] == ["done"]


def test_processes_name_each_culprit(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    aborts, hangs, raises, good = season.recordings()
    bad(monkeypatch, **{aborts: "abort", hangs: "hang", raises: "raise"})
    plan = make_plan(season)
    short = [replace(job, limit_s=1.0 if job.recording == hangs else LATE_S) for job in plan.jobs]
    executor = Processes(jobs.quick_task, 2)
    found = run_season(season, executor, replace(plan, jobs=short))
    assert found.computed == 1
    assert found.failed[aborts].endswith("computed alone: its process was ended by SIGABRT")
    assert found.failed[hangs].startswith("hangs: it was not done after 1 s")
    assert found.failed[raises] == "ZeroDivisionError: nothing to divide by"
    assert {one.recording: one.status for one in catalogue(season).records}[good] == "done"
    assert check(season) == []


def test_a_process_that_cannot_start_or_write_says_so(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, *_ = season.recordings()
    bad(monkeypatch, **{one: "disk full"})
    plan = make_plan(season)
    only = replace(plan, jobs=[job for job in plan.jobs if job.recording == one])
    with pytest.raises(DataError, match="No space left on device"):
        run_season(season, Processes(jobs.quick_task, 1), only)
    assert len(catalogue(season).records) == 0
    monkeypatch.setattr(sys, "path", ["/nowhere"])
    with pytest.raises(DataError, match=r"could not start.*No module named"):
        Child(jobs.quick_task).ask(only.jobs[0])


_KILLED = """
import sys, threading
import season_bad_jobs as jobs
from oarlock.season import open_season
from oarlock.season.erase import erase
from oarlock.season.processes import Child
from oarlock.season.run import make_plan
child = Child(jobs.quick_task)
job = make_plan(open_season({season!r})).jobs[0]
threading.Thread(target=child.ask, args=(job,), daemon=True).start()
sys.stdin.readline()
"""


def test_a_killed_command_leaves_neither_processes_nor_copies(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(jobs.BAD, json.dumps(dict.fromkeys(season.recordings(), "hang")))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    code = _KILLED.format(season=season.place.address)
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as command:
        until(lambda: jobs.begun(tmp_path / "count"))
        assert list(scratch.iterdir()) != []
        command.kill()
    until(lambda: not list(scratch.iterdir()))
    process = int((tmp_path / "count").read_text().split()[2])
    until(lambda: not Path(f"/proc/{process}").exists() or sys.platform != "linux")


def until(is_so: Callable[[], object]) -> None:
    ends_s = time.monotonic() + LATE_S
    while not is_so():
        assert time.monotonic() < ends_s
        time.sleep(0.01)


def test_cancelled_processes_end_at_once(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(jobs.BAD, json.dumps(dict.fromkeys(season.recordings(), "hang")))
    executor = Processes(jobs.quick_task, 1)
    threading.Timer(0.2, executor.cancel).start()
    assert not any(ended.reply.status == "done" for ended in executor.run(make_plan(season).jobs))
    assert catalogue(season).records == []


_ADDER = """
import sys
sys.path.insert(0, {tests!r})
import season_support as support
from oarlock.season import open_season
season = open_season({season!r})
for seed in range(100, 125):
    support.add_noise(season, "AAAAAA", seed)
"""


def test_two_adds_and_a_run_at_once_lose_and_double_nothing(season: Season, tmp_path: Path) -> None:
    code = _ADDER.format(tests=str(Path(__file__).parent), season=season.place.address)
    adders = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(2)]
    try:
        found = run_season(
            season,
            Processes(jobs.quick_task, 1),
            make_plan(season),
            look_again=lambda: make_plan(season),
        )
        assert [adder.wait(LATE_S) for adder in adders] == [0, 0]
    finally:
        for adder in adders:
            adder.kill()
    assert len(season.recordings()) == 29
    assert found.computed + done(season).computed == 29
    assert set(jobs.begun(tmp_path / "count").values()) == {1}
    assert check(season) == []


@pytest.fixture
def typed_season(tmp_path: Path) -> Path:
    """A season of one real recording and one export, without a setup."""
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA")
    Admission(season, "AAAAAA").add_recording(at_rate(load_excerpt().recording, 20.0), {"date": "2026-05-01"})
    export = Path(__file__).parents[1] / "examples/strokes/rp3.csv"
    Admission(season, "AAAAAA").add(export, {"date": "2026-05-01"})
    return tmp_path / "season"


def test_typed(typed_season: Path, tmp_path: Path) -> None:
    settings = tmp_path / "settings.toml"
    text = 'filter = "ekf"\nstructure = "tree"\n'
    settings.write_text(text)
    said = typed("season", "setup", typed_season, "--model", "sculler", "--settings", settings).stdout
    assert "oarlock season run" in said
    waits = json.loads(typed("season", "run", typed_season, "--dry-run", "--json").stdout)
    assert (waits["to_compute"], waits["up_to_date"]) == (2, 0)
    found = json.loads(typed("season", "run", typed_season, "--jobs", 1, "--json").stdout)
    assert (found["computed"], found["failed"]) == (2, {})
    again = json.loads(typed("season", "run", typed_season, "--json").stdout)
    assert (again["to_compute"], again["up_to_date"]) == (0, 2)
    season = open_season(str(typed_season))
    records = catalogue(season).records
    assert all(record.strokes > 1 for record in records)
    health = max((record.health for record in records), key=len)
    assert 0.2 < health["back.nis"] < 2.0
    assert (health["back.missing"], health["back.rejected"]) == (0.0, pytest.approx(0.0, abs=0.05))
    assert season.load_setup(season.setup).settings == text.encode()


def test_typed_mistakes_say_what_to_do(season: Season, tmp_path: Path) -> None:
    at = season.place.address
    both = typed("season", "run", at, "--jobs", 1, "--scheduler", "tcp://127.0.0.1:1", status=2)
    assert "contradict" in both.stderr
    nobody = typed("season", "setup", at, "--model", "sculler", "--athlete", "AAAAAB", status=1)
    assert "this season has no athlete" in nobody.stderr
    other = create_season(str(tmp_path / "other"), "club")
    support.squad(other, "AAAAAA")
    support.add_noise(other, "AAAAAA", 1)
    assert "oarlock season setup" in typed("season", "run", tmp_path / "other", status=2).stderr
