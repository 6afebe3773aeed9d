"""`oarlock view`: one file, and a browser if one is asked for."""

import json
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.cli import view
from oarlock.simulation import Motion


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 5.0, 501)
    swing = np.stack([0.5 * np.sin((2 + k) * time_s) for k in range(3)], axis=1)
    truth = oarlock.simulate(model, Motion(tuple(model.joint_names), time_s, swing), seed=1)[0]
    place = tmp_path_factory.mktemp("view") / "swing"
    truth.save(place)
    return place


@pytest.fixture
def browsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    asked: list[str] = []
    monkeypatch.setattr(view.webbrowser, "open", lambda url: asked.append(url) or True)
    return asked


def test_it_writes_beside_the_track_and_opens_it(folder, browsed):
    run("view", folder)
    assert browsed == [(folder / "view.html").resolve().as_uri()]
    assert "pendulum3: swing" in (folder / "view.html").read_text(encoding="utf-8")


def test_it_opens_nothing_when_told_so(folder, browsed, tmp_path):
    there = tmp_path / "new" / "a.html"
    run("view", folder, "--no-open", "--out", there)
    assert there.stat().st_size > 100_000 and not browsed


def test_json_says_what_was_written(folder, browsed, tmp_path):
    arguments = ["view", folder, "--ghost", folder, "--start-s", "1", "--end-s", "2.5", "--json"]
    done = run(*arguments, "--out", tmp_path / "a.html")
    said = json.loads(done.stdout)
    assert said["shown_s"] == [1.0, 2.5] and said["cut"] is False and not browsed
    assert said["bytes"] == (tmp_path / "a.html").stat().st_size


def test_a_long_track_is_cut_and_it_is_said(folder, browsed, tmp_path, monkeypatch):
    monkeypatch.setattr(view, "LONGEST_S", 2.0)
    done = run("view", folder, "--no-open", "--out", tmp_path / "a.html")
    assert "0 to 2 s of a longer track" in done.output


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--start-s", "3", "--end-s", "2"], 2, "--start-s 3 is not before --end-s 2"),
        (["--start-s", "30", "--end-s", "40"], 1, "no sample from 30.0 to 40.0 s"),
        (["--every-s", "0"], 1, "every_s is 0"),
        (["--ghost", "nowhere"], 1, "nowhere"),
    ],
)
def test_bad_requests_are_refused(folder, browsed, arguments, status, words):
    assert words in run("view", folder, "--no-open", *arguments, status=status).output
