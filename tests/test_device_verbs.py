"""The verbs of `oarlock import` for files of makers of inertial units."""

import json
from pathlib import Path

import oarlock
from command_line import run
from test_c3d_channels import c3d_file
from test_lines import HEADER, line, put
from test_mcap import bag as mcap_bag
from test_ngimu import unit as ngimu_unit

DATA = Path(__file__).parent / "data"


def test_the_command_line_imports_each(tmp_path):
    c3d_file(tmp_path / "trial.c3d")
    commands = {
        "mcap": [mcap_bag(tmp_path)],
        "c3d": [tmp_path / "trial.c3d"],
        "lines": [put(tmp_path, HEADER + "\n" + line(2500, 1) + line(5000, 2))],
        "ngimu": [ngimu_unit(tmp_path / "session", "Arm", "00383454").parent],
        "xdf": [DATA / "xdf/minimal.xdf"],
        "ximu3": [DATA / "ximu3"],
    }
    for verb, arguments in commands.items():
        done = run("import", verb, *arguments, "--out", tmp_path / verb, "--json")
        assert len(json.loads(done.stdout)["streams"]) == len(oarlock.load_recording(tmp_path / verb))
