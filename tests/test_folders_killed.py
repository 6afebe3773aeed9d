"""Verbs that are killed, or whose disk is full: what is left is the old state or the new one. And hostile pages."""

from __future__ import annotations

import hashlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import oarlock
from headless_chromium import chromium, quiet_tabs
from oarlock.report import write_page
from oarlock.report.viewer import page, scene
from oarlock.storage.folder_writer import read_manifest

pytestmark = pytest.mark.long

MOMENTS = 30
MAPPING = """
format = 1
[[file]]
path = "seat.csv"
time = {{ column = "t", unit = "s" }}
[[file.sensor]]
name = "seat"
value = {{ column = "x", unit = "m", offset = {offset} }}
"""
STUDY = 'format = 1\nmodel = "pendulum3"\nmotion = "{motion}"\nseeds = {seeds}\nstart_s = 0.5\n'


class Verb(NamedTuple):
    """How to run a verb on the old and on the new input, into the same folder."""

    old: list[object]
    new: list[object]
    mark: str
    """A file that tells the old state from the new one."""


def started(arguments: list[object], **settings: Any) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "oarlock", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **settings)


def ended(arguments: list[object], **settings: Any) -> tuple[int, str]:
    process = started(arguments, **settings)
    said = process.communicate()[1]
    return process.returncode, said.decode()


def fingerprint(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "none"


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings, their tracks, two CSV files with mappings and two studies."""
    root = tmp_path_factory.mktemp("world")
    model = oarlock.load_model("pendulum3")
    for name, size in (("one", 0.5), ("two", 0.3)):
        time_s = np.linspace(0.0, 4.0, 401)
        motion = oarlock.simulation.Motion(
            tuple(model.joint_names), time_s, size * np.sin(np.outer(time_s, [2.0, 3.0, 4.0]))
        )
        truth, measured = oarlock.simulate(model, motion, seed=1)
        measured.save(root / name)
        truth.save(root / f"{name}-truth")
        oarlock.track(model, measured).save(root / f"{name}-track")
        (root / f"{name}-csv").mkdir()
        rows = "".join(f"{t / 100},{size * t}\n" for t in range(2000))
        (root / f"{name}-csv/seat.csv").write_text(f"t,x\n{rows}")
        (root / f"{name}-csv/map.toml").write_text(MAPPING.format(offset=size))
        seeds = 2 if name == "one" else 3
        (root / f"{name}.toml").write_text(STUDY.format(motion=root / f"{name}-truth", seeds=seeds))
    return root


def verbs(world: Path, out: Path) -> dict[str, Verb]:
    def both(mark: str, command: Callable[[str], list[object]]) -> Verb:
        return Verb(command("one"), command("two"), mark)

    simulated = ["simulate", "--out", out, "--duration-s", 3, "--force", "--seed"]
    return {
        "track": both(
            "track.parquet",
            lambda n: ["track", world / n, "--model", "pendulum3", "--out", out, "--force"],
        ),
        "simulate": Verb([*simulated, 1], [*simulated, 2], "seat.parquet"),
        "import": both(
            "seat.parquet",
            lambda n: ["import", "csv", world / f"{n}-csv/map.toml", "--out", out, "--force"],
        ),
        "report": both(
            "report.html", lambda n: ["report", world / f"{n}-track", "--out", out / "report.html", "--force"]
        ),
        "export": both(
            "coordinates.csv", lambda n: ["export", world / f"{n}-track", "--out", out, "--force"]
        ),
        "study": both(
            "runs.csv",
            lambda n: ["lab", "study", world / f"{n}.toml", "--jobs", 1, "--out", out, "--force"],
        ),
    }


NAMES = ("track", "simulate", "import", "report", "export", "study")


def is_whole(out: Path) -> bool:
    """Whether every file that the manifest lists is there and as it was written, and no other table is."""
    manifest = read_manifest(out)
    if not manifest.kinds:
        return True
    there = {
        f.relative_to(out).as_posix() for f in out.rglob("*") if f.is_file() and ".oarlock" not in f.parts
    }
    extra = there - set(manifest.sha256) - {"oarlock-manifest.toml", "unfinished.jsonl"}
    return not extra and all(manifest.is_unchanged(name) for name in manifest.sha256)


@pytest.mark.parametrize("over_old", [True, False])
@pytest.mark.parametrize("name", NAMES)
def test_killed_at_thirty_moments(world: Path, tmp_path: Path, name: str, over_old: bool) -> None:
    out = tmp_path / "out"
    verb = verbs(world, out)[name]
    assert ended(verb.new)[0] == 0
    new = fingerprint(out / verb.mark)
    shutil.rmtree(out)
    begun = time.monotonic()
    assert ended(verb.old)[0] == 0
    whole_s = time.monotonic() - begun
    old = fingerprint(out / verb.mark)
    assert old != new
    chance, seen = random.Random(f"{name}{over_old}"), set()
    kept = tmp_path / "kept"
    shutil.copytree(out, kept)
    for _ in range(MOMENTS):
        shutil.rmtree(out, ignore_errors=True)
        if over_old:
            shutil.copytree(kept, out)
        process = started(verb.new)
        time.sleep(chance.uniform(0.4, 1.1) * whole_s)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert is_whole(out)
        state = fingerprint(out / verb.mark)
        assert state in ({old, new} if over_old else {"none", new})
        seen.add(state)
    status, said = ended(verb.new)
    assert status == 0, said
    assert fingerprint(out / verb.mark) == new and not (out / ".oarlock").exists()
    assert seen, "some moment was tried"


@pytest.mark.parametrize("name", NAMES)
def test_a_limit_on_file_size_leaves_the_old_state(world: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "out"
    verb = verbs(world, out)[name]
    assert ended(verb.old)[0] == 0
    before = {file: fingerprint(file) for file in out.rglob("*")}
    largest = max(file.stat().st_size for file in out.rglob("*"))
    limit = largest // 2

    def small() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    status, said = ended(verb.new, preexec_fn=small)
    assert status == 1 and "cannot be written" in said and "Traceback" not in said, said
    kept = {file: fingerprint(file) for file in out.rglob("*") if file.name != "unfinished.jsonl"}
    assert kept == before


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", place], capture_output=True, check=False
    )
    if made.returncode != 0:
        pytest.skip(
            f"A FULL DISK WAS NOT TRIED: a small one cannot be mounted here ({made.stderr.decode().strip()})"
        )
    yield place
    subprocess.run(["umount", "-l", place], check=True)


@pytest.mark.parametrize("name", NAMES)
def test_a_full_disk_leaves_the_old_state(world: Path, small_disk: Path, name: str) -> None:
    out = small_disk / "out"
    verb = verbs(world, out)[name]
    assert ended(verb.old)[0] == 0
    before = {file: fingerprint(file) for file in out.rglob("*")}
    free = os.statvfs(small_disk)
    room = min(20_000, max(file.stat().st_size for file in out.rglob("*")) // 2)
    (small_disk / "filled").write_bytes(b"x" * (free.f_bavail * free.f_frsize - room))
    status, said = ended(verb.new)
    assert status == 1 and "cannot be written" in said and "Traceback" not in said, said
    kept = {file: fingerprint(file) for file in out.rglob("*") if file.name != "unfinished.jsonl"}
    assert kept == before
    (small_disk / "filled").unlink()
    assert ended(verb.new)[0] == 0


# --- pages ----------------------------------------------------------------------------------------------

HOSTILE = [
    "<script>window.ran = 1</script>",
    "</script><script>window.ran = 1</script>",
    "<img src=x onerror='window.ran = 1'>",
    "<svg onload='window.ran = 1'><a href='javascript:window.ran=1'>x</a></svg>",
    "\"><iframe srcdoc='<script>parent.ran=1</script>'>",
    "' onmouseover='window.ran = 1",
    "<a href='https://example.org/'>link</a><link rel=stylesheet href='https://example.org/x.css'>",
    "\u202eevil\u2066 <b>bold</b> \u200f {{7*7}} ${window.ran=1}",
    "<!-- --><style>*{display:none}</style>",
    "x" * 10_000,
]


@pytest.fixture(scope="module")
def hostile_pages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("pages")
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 2.0, 201)
    motion = oarlock.simulation.Motion(
        tuple(model.joint_names), time_s, 0.5 * np.sin(np.outer(time_s, [2.0, 3.0, 4.0]))
    )
    truth, measured = oarlock.simulate(model, motion, seed=1)
    named = [
        oarlock.recording.ScalarStream(text[:80], stream.time_s, stream.gyro_rad_s[:, 0])
        for text, stream in zip(HOSTILE[:3], measured, strict=True)
    ]
    noted = oarlock.Recording([*measured, *named], {"athlete": HOSTILE[0], "rig": {HOSTILE[2]: HOSTILE[3]}})
    track = oarlock.track(model, noted.only(model.sensor_names)).with_notes(*HOSTILE)
    write_page(track, folder / "report.html", truth=truth, title=HOSTILE[0])
    write_page(track, folder / "long.html", title=HOSTILE[-1])
    (folder / "view.html").write_text(page(scene(track, title=HOSTILE[1]), HOSTILE[1]), encoding="utf-8")
    return sorted(folder.iterdir())


def test_hostile_pages_run_nothing(hostile_pages: list[Path]) -> None:
    with chromium("HOSTILE PAGES WERE NOT OPENED") as browser, quiet_tabs(browser, ("GPU stall",)) as open_:
        for file in hostile_pages:
            tab = open_(file)
            tab.wait_for_timeout(500)
            assert tab.evaluate("window.ran") is None, file.name
            assert tab.locator("iframe, a[href^='javascript'], a[href^='http'], img[src=x]").count() == 0
            wide = tab.evaluate("document.documentElement.scrollWidth - window.innerWidth")
            assert wide <= 1, f"{file.name} is {wide} px wider than the window"
