"""Ctrl-C ends every long call well before its own end, and leaves no half of a result."""

import json
import signal
import subprocess
import sys

import pytest

import oarlock

HANGS_S = 600.0
"""Guard against what never ends, many times the usual duration."""
EARLY = 0.6
"""Share of a call's own duration in which it has to end; it is stopped after a fifth. On an idle machine: 0.21."""

ALONE = """
import json, os, signal, sys, threading, time
import oarlock
from oarlock import rowing
from oarlock.rowing.simulation.experiment import simulate_sculling

model = oarlock.load_model("sculler")
truth, recording = simulate_sculling(model, "S-B", 30.0, seed=1)
track = oarlock.track(model, recording)
calls = {
    "track": lambda: oarlock.track(model, recording),
    "smooth": lambda: oarlock.smooth(track),
    "track_many": lambda: oarlock.track_many(model, [recording] * 3),
    "evaluate": lambda: oarlock.evaluate(track, truth),
    "simulate": lambda: simulate_sculling(model, "S-B", 60.0, seed=1),
    "calibrate_motion": lambda: oarlock.calibrate_motion(model, recording.slice(0.0, 15.0)),
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
    oarlock.calibrate_motion(model, recording, progress=shares.append)
    assert shares == sorted(shares) and len(shares) > 5
    assert 0.0 <= shares[0] < 0.1 and 0.35 < shares[-1] <= 1.0, (
        "beyond the first hypothesis, and never beyond the end"
    )
