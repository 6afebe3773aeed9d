"""Every input of every verb, given what is no file: a pipe, a device, a folder, an empty file. A clear error each."""

import os
import typing
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import oarlock
from command_line import run
from oarlock.cli import app
from test_every_verb import ALL, app_verb

WRITTEN = {"csv", "keys", "fit", "out", "parquet", "report_file", "rowingdata", "save_mapping", "svg", "to"}
WRITTEN |= {"write", "write_plan", "written"}
TEXT_PLACES = {"at", "season", "file", "model", "body", "name", "settings"}
# They make what they are given, or wait for senders.
OWN_WAY = {
    ("season init", "at"),
    ("season init", "name"),
    ("lab season", "at"),
}
OWN_WAY |= {
    ("live run", "plan"),
    ("model copy", "file"),
    ("lab emulate", "path"),
    ("lab emulate", "rig_file"),
}
FILLED = {"stature_m": "1.8", "metric": "rate_per_min", "sql": "SELECT 1", "on": "upper"}
FILLED |= {"model": "pendulum3", "body": "pendulum3", "name": "pendulum3", "run": "1", "what": "figures"}
TRACKS = {"evaluate", "report", "export", "view", "video align"}


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    folder = tmp_path_factory.mktemp("places")
    time_s = np.arange(60) / 50.0
    up = np.tile([0.1, 9.8, 0.0], (60, 1))
    model = oarlock.load_model("pendulum3")
    streams = [
        oarlock.recording.ImuStream(name, time_s, gyro_rad_s=0.0 * up, accel_m_s2=up)
        for name in model.sensor_names
    ]
    oarlock.Recording(streams).save(folder / "recording")
    oarlock.track(model, oarlock.Recording(streams)).save(folder / "track")
    os.mkfifo(folder / "pipe")
    (folder / "empty").touch()
    (folder / "folder").mkdir()
    (folder / "unreadable").touch(mode=0)
    run("season", "init", folder / "season")
    return folder


def inputs(verb):
    """The parameters of a verb that name something to read."""
    for param in app_verb(verb).params:
        kind = param.type_descriptor.annotation
        is_path = kind is Path or Path in typing.get_args(kind)
        if (
            (is_path or param.name in TEXT_PLACES)
            and param.name not in WRITTEN
            and (verb, param.name) not in OWN_WAY
        ):
            yield param


def command(verb, hostile, place, places, out):
    words = [] if verb.endswith("PATH") else verb.split()
    words = words or verb.split()[:1]
    words += ["lines", "--duration-s", "0.1"] if verb == "lab emulate" else []
    filled = FILLED | {"out": out, "to": out, "at": places / "season", "season": places / "season"}
    for param in app_verb(verb).params:
        if param is hostile:
            value = place
        elif not param.required:
            continue
        else:
            value = filled.get(param.name, places / ("track" if verb in TRACKS else "recording"))
        words += [str(value)] if param.param_type_name == "argument" else [param.opts[0], str(value)]
    return words


PAIRS = [pytest.param(verb, param, id=f"{verb} {param.name}") for verb in ALL for param in inputs(verb)]


@pytest.mark.parametrize(("verb", "param"), PAIRS)
def test_what_is_no_file_gets_a_clear_error(verb, param, places, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kinds = {
        "pipe": places / "pipe",
        "device": Path("/dev/zero"),
        "folder": places / "folder",
        "empty": places / "empty",
    }
    if os.geteuid():
        kinds["unreadable"] = places / "unreadable"
    for kind, place in kinds.items():
        words = command(verb, param, place, places, tmp_path / kind)
        done = CliRunner().invoke(app, words, prog_name="oarlock")
        said = done.output
        # An empty file of settings or names changes nothing.
        assert done.exit_code in (1, 2) or kind == "empty", (words, done.exit_code, said)
        assert "a fault in oarlock" not in said and "Traceback" not in said, (words, said)
        assert len(said.strip()) > 10, words
