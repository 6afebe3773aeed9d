"""The required dependencies alone load, track, smooth, save and report; what needs scipy or pyarrow says so."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BLOCKED = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("scipy", "pyarrow", "pandas"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
"""
PIPELINE = """
import numpy as np
import oarlock

recording = oarlock.import_recording("{root}/examples/pendulum/imuData01.csv")
for kind in ("csv", "parquet"):
    recording.save("recording", file_format=kind, force=True)
    again = oarlock.load_recording("recording")
    assert again.names == recording.names
    for name in again.names:
        np.testing.assert_array_equal(again[name].gyro_rad_s, recording[name].gyro_rad_s)
track = oarlock.track(oarlock.load_model("pendulum3"), again)
smoothed = oarlock.smooth(track)
smoothed.save("track")
loaded = oarlock.load_track("track")
for name, values in smoothed.columns().items():
    np.testing.assert_array_equal(loaded.columns()[name], values, name)
np.testing.assert_array_equal(loaded.beliefs.covariance, smoothed.beliefs.covariance)
assert set(oarlock.export(loaded, "tables").files) > {{"angles.csv", "coordinates.mot", "model.osim"}}
assert oarlock.write_report(loaded, "report.html")
"""


def run(code, folder):
    return subprocess.run([sys.executable, "-c", BLOCKED + code], cwd=folder, capture_output=True, text=True)


def test_from_a_file_to_a_report_without_scipy_and_pyarrow(tmp_path):
    done = run(PIPELINE.format(root=ROOT), tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "report.html").stat().st_size > 10_000


def test_track_of_the_command_line(tmp_path):
    assert run(PIPELINE.format(root=ROOT), tmp_path).returncode == 0
    command = ["track", "recording", "--model", "pendulum3", "--smooth", "--csv", "--out", "out"]
    done = run(f"from oarlock.cli import main; sys.argv[1:] = {command}; main()", tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"report.html", "sensors.csv", "track.csv", "track.parquet"} <= {
        f.name for f in tmp_path.glob("out/*")
    }


@pytest.mark.parametrize(
    "command",
    [
        ["simulate", "--field", "careful", "--duration-s", "5", "--out", "piece"],
        ["season", "query", "club", "SELECT 1"],
        ["lab", "study", "which_sensors", "--out", "sensors"],
    ],
)
def test_a_command_that_needs_them_says_so_in_one_line(tmp_path, command):
    if command[0] == "season":
        run("from oarlock.cli import main; sys.argv[1:] = ['season', 'init', 'club']; main()", tmp_path)
    done = run(f"from oarlock.cli import main; sys.argv[1:] = {command}; main()", tmp_path)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and "needs" in done.stderr, done.stderr
    assert "pip install 'oarlock[full]'" in done.stderr


def test_a_name_that_needs_them_says_so(tmp_path):
    done = run("import oarlock; oarlock.simulate", tmp_path)
    assert "ModuleNotFoundError: oarlock.simulate needs scipy: pip install 'oarlock[full]'\n" in done.stderr


def test_help_imports_neither_numpy_nor_what_verbs_need(tmp_path):
    code = """
from oarlock.cli import main

sys.argv[1:] = ["track", "--help"]
try:
    main()
except SystemExit:
    print({name.split(".")[1] for name in sys.modules if name.startswith("oarlock.")})
    print({"numpy", "jinja2", "tomlkit", "websockets"} & set(sys.modules))
"""
    *_, rooms, libraries = run(code, tmp_path).stdout.strip().splitlines()
    assert not {"evaluation.summary", "report"} & eval(rooms) and eval(libraries) == set()
