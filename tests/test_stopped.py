"""Ctrl-C ends every long call well before its own end, and leaves no half of a result."""

import json
import signal
import subprocess
import sys

import pytest

import oarlock
from command_line import run

HANGS_S = 600.0
"""Guard against what never ends, many times the usual duration."""
EARLY = 0.6
"""Share of a call's own duration in which it has to end; it is stopped after a fifth. On an idle machine: 0.21."""

ALONE = """
import json, os, signal, sys, threading, time
import numpy as np
import oarlock
from oarlock import _core, rowing
from oarlock.rowing.simulation.experiment import simulate_sculling

model = oarlock.load_model("sculler")
truth, whole = simulate_sculling(model, "S-B", 180.0, seed=1)  # the search of the start takes 0.9 s by itself
recording = whole.slice(0.0, 30.0)
track = oarlock.track(model, recording)
rng, still = np.random.default_rng(1), np.zeros((400_000, len(model.coordinate_names)))

def unit(name):
    time_s, turning = np.arange(60_000) / 100.0, np.cumsum(rng.normal(size=(60_000, 3)), axis=0) / 50.0
    force = rng.normal(size=(60_000, 3)) + [0.0, 0.0, 9.81]
    return {"name": name, "time_s": time_s, "gyro_rad_s": turning, "accel_m_s2": force, "mag_ut": None}

pair, axes = (unit("one"), unit("two")), [[1.0, 0.0, 0.0]] * 2
calls = {
    "joint_center": lambda: _core.find_joint_center(*pair, [[0.0] * 3] * 2, 0.2, 0.3),
    "hinge_axis": lambda: _core.find_hinge_axis(*pair, axes, [1.5, 1.5], 0.1),
    "forward_kinematics": lambda: model.forward_kinematics(still),
    "predict_measurements": lambda: model.predict_measurements(still, still, still),
    "measurement_jacobian": lambda: model.measurement_jacobian(*[still[:20_000]] * 3),
    "frame_jacobian": lambda: model.frame_jacobian(still[:50_000]),
    "track": lambda: oarlock.track(model, whole),
    "smooth": lambda: oarlock.smooth(track),
    "track_many": lambda: oarlock.track_many(model, [whole] * 3),
    "evaluate": lambda: oarlock.evaluate(track, truth),
    "simulate": lambda: simulate_sculling(model, "S-B", 60.0, seed=1),
    "calibrate_motion": lambda: oarlock.calibration.calibrate_motion(model, recording.slice(0.0, 15.0)),
}
shares = {}
for name in sys.argv[1:]:
    call = calls[name]
    call()  # what is loaded once
    began_s = time.perf_counter()
    call()
    whole_s = time.perf_counter() - began_s
    threading.Timer(0.2 * whole_s, os.kill, (os.getpid(), signal.SIGINT)).start()
    began_s = time.perf_counter()
    try:
        call()
    except KeyboardInterrupt:
        shares[name] = (time.perf_counter() - began_s) / whole_s
print(json.dumps(shares))
"""

STARTING = """
import signal, sys
module, sys.argv[1:] = sys.argv[1], ["model", "check", "arm7"]

class Stop:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            # As in a dataclass: CPython notes that Ctrl-C came within a text.
            exec("signal.raise_signal(signal.SIGINT)")

sys.meta_path.insert(0, Stop())
from oarlock.cli import main
main()
"""
"""A command that is stopped when it imports a module."""


def shares_of(*names: str) -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, "-c", ALONE, *names], capture_output=True, text=True, timeout=HANGS_S
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, float] = json.loads(done.stdout)
    return found


@pytest.mark.long
def test_every_long_call_ends_early():
    names = ("track", "smooth", "track_many", "evaluate", "simulate", "calibrate_motion")
    shares = shares_of(*names)
    assert set(shares) == set(names), "the others were not stopped at all"
    assert all(share < EARLY for share in shares.values()), shares


@pytest.mark.long
def test_every_search_and_loop_of_the_extension_ends_early():
    names = ("joint_center", "hinge_axis", "forward_kinematics", "predict_measurements")
    names += ("measurement_jacobian", "frame_jacobian")
    shares = shares_of(*names)
    assert set(shares) == set(names), "the others were not stopped at all"
    assert all(share < EARLY for share in shares.values()), shares


@pytest.mark.parametrize("module", ["typer", "typer.main", "oarlock.cli.model", "oarlock.model.extends"])
def test_ctrl_c_at_the_start_of_a_command_is_one_line_and_a_status(module):
    done = subprocess.run([sys.executable, "-c", STARTING, module], capture_output=True, text=True)
    assert done.returncode == 130, done.stderr
    assert done.stderr.startswith("error: stopped by Ctrl-C") and done.stderr.count("\n") == 1


def test_a_verb_that_goes_on_says_so(tmp_path, monkeypatch):
    def stopped(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("oarlock.evaluation.study.pool.all_rows", stopped)
    said = run("lab", "study", "mount_error", "--out", tmp_path / "study", status=130).stderr
    assert "what is finished is kept; the same command continues from there" in said


@pytest.mark.long
def test_a_command_says_that_it_was_stopped_and_leaves_no_file(tmp_path):
    from oarlock.rowing.simulation.experiment import simulate_sculling

    _, recording = simulate_sculling(oarlock.load_model("sculler"), "S-B", 240.0, seed=1)
    recording.save(tmp_path / "rec")
    command = [sys.executable, "-m", "oarlock", "calibrate", "motion", str(tmp_path / "rec")]
    command += ["--model", "sculler", "--out", str(tmp_path / "cal.toml")]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert running.stderr is not None
    assert running.stderr.readline().startswith("calibrating: ")  # the sign of life is the moment to stop it
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=HANGS_S)
    assert running.returncode == 130, said
    assert "stopped by Ctrl-C" in said
    assert not (tmp_path / "cal.toml").exists()


@pytest.mark.long
def test_shares_of_self_calibration_rise():
    from oarlock import rowing

    model = oarlock.load_model("sculler")
    _, recording = oarlock.simulate(model, rowing.sculling(model, duration_s=9.0), rate_hz=40.0, seed=1)
    shares: list[float] = []
    oarlock.calibration.calibrate_motion(model, recording, progress=shares.append)
    assert shares == sorted(shares) and len(shares) > 5
    assert 0.0 <= shares[0] < 0.1 and 0.35 < shares[-1] <= 1.0, (
        "beyond the first hypothesis, and never beyond the end"
    )
