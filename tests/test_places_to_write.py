"""Each verb that writes: into an empty folder, into folders that are missing, and onto a disk that is read-only."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run

MAPPING = """
format = 1
[[file]]
path = "seat.csv"
time = { column = "t", unit = "s" }
[[file.sensor]]
name = "seat"
value = { column = "x", unit = "m" }
"""
INTO_FOLDERS = {
    "simulate": ["simulate", "--duration-s", 2, "--out", "{place}"],
    "track": ["track", "{world}/rec", "--model", "pendulum3", "--out", "{place}"],
    "import": ["import", "csv", "{world}/map.toml", "--out", "{place}"],
    "export": ["export", "{world}/track", "--out", "{place}"],
    "study": ["lab", "study", "{world}/study.toml", "--jobs", 1, "--out", "{place}"],
    "strokes": ["rowing", "strokes", "{world}/rowed", "--out", "{place}"],
}
INTO_FILES = {
    "report": ["report", "{world}/track", "--out", "{place}/page.html"],
    "view": ["view", "{world}/track", "--no-open", "--out", "{place}/page.html"],
    "copy": ["model", "copy", "arm7", "{place}/mine.toml"],
    "show": ["model", "show", "arm7", "--svg", "{place}/pose.svg"],
    "stature": ["calibrate", "stature", 1.8, "--model", "sculler", "--out", "{place}/person.toml"],
    "plan": [
        *["calibrate", "session", "--model", "sculler"],
        *["--write-plan", "{place}/plan.toml", "--out", "{place}/found.toml"],
    ],
}
VERBS = INTO_FOLDERS | INTO_FILES


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording, its track, a CSV file with its mapping, a study, and oars that row."""
    root = tmp_path_factory.mktemp("world")
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 2.0, 201)
    swing = 0.5 * np.sin(np.outer(time_s, [2.0, 3.0, 4.0]))
    truth, measured = oarlock.simulate(
        model, oarlock.simulation.Motion(tuple(model.joint_names), time_s, swing), seed=1
    )
    measured.save(root / "rec")
    truth.save(root / "truth")
    oarlock.track(model, measured).save(root / "track")
    rowed_s = np.linspace(0.0, 8.0, 801)
    oar = oarlock.recording.ScalarStream("r_oar_phi", rowed_s, -0.9 * np.cos(np.pi * rowed_s))
    oarlock.Recording([oar]).save(root / "rowed")
    (root / "seat.csv").write_text("t,x\n" + "".join(f"{k / 100},{0.1 + k / 1000}\n" for k in range(300)))
    (root / "map.toml").write_text(MAPPING)
    (root / "study.toml").write_text(
        f'format = 1\nmodel = "pendulum3"\nmotion = "{root / "truth"}"\nseeds = 1\nstart_s = 0.5\n'
    )
    return root


@pytest.fixture(scope="module")
def read_only(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder that nobody can write into; root may write wherever the disk is not read-only."""
    place = tmp_path_factory.mktemp("read-only")
    if os.geteuid() != 0:
        place.chmod(0o555)
        yield place
        place.chmod(0o755)
        return
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "ro,size=1m", "tmpfs", place], capture_output=True, check=False
    )
    if made.returncode != 0:
        pytest.skip(f"A READ-ONLY DISK WAS NOT TRIED: {made.stderr.decode().strip()}")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


def typed(verb: str, world: Path, place: Path) -> list[str]:
    return [str(part).format(world=world, place=place) for part in VERBS[verb]]


def files_in(place: Path) -> list[str]:
    return sorted(file.name for file in place.rglob("*") if file.is_file())


@pytest.mark.parametrize("verb", VERBS)
def test_into_an_empty_folder_and_into_missing_ones(verb: str, world: Path, tmp_path: Path) -> None:
    empty, missing = tmp_path / "empty", tmp_path / "not" / "yet" / "there"
    empty.mkdir()
    run(*typed(verb, world, empty))
    run(*typed(verb, world, missing))
    assert files_in(empty) == files_in(missing) != []
    assert not list(tmp_path.rglob(".oarlock*"))


@pytest.mark.parametrize("verb", VERBS)
def test_onto_a_read_only_disk(verb: str, world: Path, read_only: Path) -> None:
    for place in (read_only, read_only / "new"):
        said = " ".join(run(*typed(verb, world, place), status=1).stderr.split())
        assert f"{place}: cannot be written" in said and said.endswith("a folder that you may write into."), (
            said
        )
    assert not list(read_only.rglob("*"))


@pytest.mark.parametrize("verb", VERBS)
def test_a_file_is_no_folder(verb: str, world: Path, tmp_path: Path) -> None:
    (tmp_path / "note").write_text("mine")
    done = run(*typed(verb, world, tmp_path / "note" / "in"), status=1)
    said = " ".join(done.stderr.split())
    assert f"{tmp_path / 'note'}" in said and "Traceback" not in said and "fault" not in said, said
    assert files_in(tmp_path) == ["note"] and (tmp_path / "note").read_text() == "mine"
