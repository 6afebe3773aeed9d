"""The verbs that import files of makers of inertial units, each on a small file."""

import json

import pytest

from command_line import run
from oarlock import load_recording
from oarlock.formats.contents import recognised
from oarlock.formats.importers import FORMATS
from oarlock.formats.listing import listed
from test_io_dot import HEAD, RATES
from test_io_mtmanager import SAMPLES
from test_io_mvnx import TRIAL
from test_io_shimmer import SESSION
from test_io_sto import SAMPLE


def test_the_command_line_imports_each(tmp_path):
    dot = HEAD.format(tag="Arm", sync="Synced", mode="Rate quantities") + RATES
    for name, text in (("dot.csv", dot), ("shimmer.csv", SESSION), ("trial.mvnx", TRIAL)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    commands = {
        "mtmanager": [str(SAMPLES), "--trial", "MT46_01-000", "--orientations"],
        "dot": [str(tmp_path / "dot.csv")],
        "shimmer": [str(tmp_path / "shimmer.csv"), "--accel", "WR"],
        "mvnx": [str(tmp_path / "trial.mvnx")],
        "sto": [str(SAMPLE), "--up", "y"],
    }
    streams = {"mtmanager": 4, "dot": 1, "shimmer": 1, "mvnx": 4, "sto": 7}
    for verb, arguments in commands.items():
        done = run("import", verb, *arguments, "--out", str(tmp_path / verb), "--json")
        recording = load_recording(tmp_path / verb)
        assert len(json.loads(done.stdout)["streams"]) == len(recording) == streams[verb]
        assert recording.meta["source"]["format"] == verb


@pytest.mark.parametrize("form", ["mtmanager", "dot", "shimmer", "mvnx", "sto"])
def test_each_file_is_recognised_by_one_format(form, tmp_path):
    dot = HEAD.format(tag="Arm", sync="Synced", mode="Rate quantities") + RATES
    texts = {
        "mtmanager": ("MT_00B42D4D.txt", (SAMPLES / "MT46_01-000_00B42D4D.txt").read_text(encoding="utf-8")),
        "dot": ("dot.csv", dot),
        "shimmer": ("shimmer.csv", SESSION),
        "mvnx": ("trial.mvnx", TRIAL),
        "sto": ("turns.sto", SAMPLE.read_text(encoding="utf-8")),
    }
    name, text = texts[form]
    (tmp_path / name).write_text(text, encoding="utf-8")
    found = recognised(listed(tmp_path))
    assert [one.format for one in found] == [form]
    (known,) = (known for known in FORMATS if known.name == form)
    assert len(known.read(found[0].path, **found[0].options)) > 0
