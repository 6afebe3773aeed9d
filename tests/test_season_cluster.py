"""A season on a real Dask cluster: workers and the scheduler are killed, and the results are those of this machine."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

import season_bad_jobs as jobs
import season_support as support
from exact_recording import sculler
from oarlock import DataError
from oarlock.season import Season, create_season, open_season
from oarlock.season.cluster import DaskCluster
from oarlock.season.compute import choose_setup, make_setup
from oarlock.season.processes import Processes
from oarlock.season.run import Plan, RunCounts, make_plan, run_season
from oarlock.season.upkeep import check

pytest.importorskip("distributed")
pytestmark = pytest.mark.long

RECORDINGS, WORKERS = 40, 4
LATE_S = 300.0
HANGS_S = 3.0
Process = subprocess.Popen[bytes]


class Cluster:
    """A scheduler and workers, each a process that speaks TCP with the others."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "scheduler.json"
        self._folder = folder
        self.scheduler = self._started("scheduler", "--no-show", "--port", "0", "--host", "127.0.0.1")
        until(self._file.exists)
        self.address = str(json.loads(self._file.read_text())["address"])
        self.workers = [self._worker("--nanny" if k == 0 else "--no-nanny") for k in range(WORKERS)]

    def _worker(self, nanny: str) -> Process:
        return self._started(
            "worker", "--nthreads", "1", nanny, "--local-directory", str(self._folder / "work")
        )

    def _started(self, what: str, *options: str) -> Process:
        command = [sys.executable, "-m", "dask", what, *options, "--no-dashboard"]
        with (self._folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [*command, "--scheduler-file", str(self._file)], stdout=log, stderr=log, env=environment()
            )

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.terminate()
        for process in (*self.workers, self.scheduler):
            try:
                process.wait(30.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._file.unlink(missing_ok=True)  # a scheduler that ends by itself removes it


def environment() -> dict[str, str]:
    """For workers: the package and these tests can be imported."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    one = Cluster(folder)
    try:
        yield one
    finally:
        one.end()


def until(is_so: Callable[[], bool]) -> None:
    ends_s = time.monotonic() + LATE_S
    while not is_so():
        assert time.monotonic() < ends_s
        time.sleep(0.02)


@pytest.fixture
def season(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Season:
    """With one recording that aborts its process, one that hangs, one that raises, and one that is damaged."""
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA")
    names = sorted(support.add_noise(season, "AAAAAA", seed) for seed in range(RECORDINGS))
    monkeypatch.setenv(jobs.BAD, json.dumps({names[5]: "abort", names[9]: "hang", names[13]: "raise"}))
    damaged = tmp_path / "season/athlete=AAAAAA/recordings" / names[17] / "trunk.parquet"
    damaged.write_bytes(damaged.read_bytes()[:-1])
    return choose_setup(season, make_setup(sculler()))


def planned(season: Season) -> Plan:
    """Only the recording that hangs has little time."""
    plan = make_plan(season)
    hangs = [name for name, how in json.loads(os.environ[jobs.BAD]).items() if how == "hang"]
    limited = [replace(job, limit_s=HANGS_S if job.recording in hangs else LATE_S) for job in plan.jobs]
    return replace(plan, jobs=limited)


def results(season: Season) -> dict[str, bytes]:
    return {name: season.place.read(name) for name, _ in season.place.files("athlete=AAAAAA/results")}


def on_cluster(season: Season, address: str, during: Callable[[float], None]) -> RunCounts:
    return run_season(season, DaskCluster(jobs.waiting_task, address), planned(season), during)


def test_deaths_change_no_byte_and_nothing_is_computed_again(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(tmp_path / "season", tmp_path / "here")
    here = open_season(str(tmp_path / "here"))
    at_home = run_season(here, Processes(jobs.quick_task, 2), planned(here))
    assert len(at_home.failed) == 4

    count = tmp_path / "count"
    monkeypatch.setenv(jobs.COUNT, str(count))
    with cluster(tmp_path) as one:

        def worker_then_scheduler_die(share: float) -> None:
            if share > 0.2 and one.workers[1].poll() is None:
                one.workers[1].kill()
            if share > 0.5 and one.scheduler.poll() is None:
                one.scheduler.kill()

        with pytest.raises(DataError, match="the scheduler does not answer any more"):
            on_cluster(season, one.address, worker_then_scheduler_die)
    stored = len(make_plan(season).failed) + make_plan(season).there
    assert RECORDINGS // 2 - 1 <= stored < RECORDINGS
    with cluster(tmp_path) as one:

        def worker_dies(share: float) -> None:
            if share > 0.3 and one.workers[2].poll() is None:
                one.workers[2].kill()

        found = on_cluster(season, one.address, worker_dies)
    failed = {**make_plan(season).failed, **found.failed}
    assert failed == at_home.failed
    assert make_plan(season).there == RECORDINGS - 4
    assert results(season) == results(here)
    assert jobs.begun_after_stored(count) == []
    assert len(jobs.begun(count)) == RECORDINGS
    assert check(here) == check(season)
    assert [one.what for one in check(season)] == ["damaged"]


@pytest.fixture
def bucket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An address on a server that speaks S3's protocol, in a process of its own."""
    pytest.importorskip("obstore")
    boto3 = pytest.importorskip("boto3")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    endpoint = f"http://127.0.0.1:{port}"
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    with (tmp_path / "moto.log").open("wb") as log:
        server = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        until(lambda: answers(port))
        boto3.client("s3", endpoint_url=endpoint, region_name="us-east-1").create_bucket(Bucket="club")
        yield "s3://club/season"
    finally:
        server.kill()
        server.wait()


def answers(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


def test_an_object_store_has_the_same_results(season: Season, bucket: str) -> None:
    there = create_season(bucket, "club")
    support.squad(there, "AAAAAA")
    for seed in range(RECORDINGS):
        support.add_noise(there, "AAAAAA", seed)
    there = choose_setup(there, make_setup(sculler()))
    damaged = [
        name for name, _ in season.place.files("athlete=AAAAAA/recordings") if name.endswith("trunk.parquet")
    ]
    for name in damaged:
        there.place.write(name, season.place.read(name))
    run_season(season, Processes(jobs.quick_task, 2), planned(season))
    assert run_season(there, Processes(jobs.quick_task, 2), planned(there)).computed == RECORDINGS - 4
    assert results(there) == results(season)
    assert make_plan(there).jobs == []


def test_where_no_scheduler_is_it_says_how_to_start_one(season: Season) -> None:
    with pytest.raises(DataError, match=r"no Dask scheduler answers there.*`dask scheduler`"):
        DaskCluster(jobs.quick_task, "tcp://127.0.0.1:9")
