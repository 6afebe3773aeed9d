"""The verbs of `oarlock import` for files of makers of inertial units."""

import json
from pathlib import Path

import oarlock
from command_line import run

DATA = Path(__file__).parent / "data"


def test_the_command_line_imports_each(tmp_path):
    commands = {
        "xdf": [DATA / "xdf/minimal.xdf"],
        "ximu3": [DATA / "ximu3"],
    }
    for verb, arguments in commands.items():
        done = run("import", verb, *arguments, "--out", tmp_path / verb, "--json")
        assert len(json.loads(done.stdout)["streams"]) == len(oarlock.load_recording(tmp_path / verb))
