"""Smoothing: iterations, and that smoothed estimates are no worse than live ones on recordings with a reference."""

from pathlib import Path

import numpy as np
import pytest
from pages.recordings import read_simulated
from pages.sculling import ELEVEN, angles
from validation import ours, scores

import oarlock
from local_data import local_folder
from oarlock.formats.datasets.broad import BODY, read_broad, read_broad_reference
from oarlock.formats.datasets.dfjimu import BODIES, read_dfjimu, read_dfjimu_reference
from refusals import assert_refused

RELATIVE, ABSOLUTE_DEG = 0.05, 0.05
"""By how much a smoothed error may exceed the live one: a smoother uses the same model, and where that is wrong it may
be wrong in another way."""
TRIALS = ("1D_01", "2D_01", "3D_01", "3D_03", "3D_05")
SIMULATED = ("exact_S-NB_0", "misfit_0", "wild_0", "wild_7")
START_S = 10.0


@pytest.fixture(scope="module")
def live() -> oarlock.Track:
    """Two links on a ball joint that turn about all axes; no magnetometer."""
    model = oarlock.load_model("dfjimu", parameters={"r1_x": 0.2, "r2_y": -0.15})
    time_s = np.arange(0.0, 6.0, 0.01)
    names = model.coordinate_names
    speeds = 2.0 * np.pi * (0.3 + 0.13 * np.arange(len(names)))
    q = 0.5 * np.sin(time_s[:, None] * speeds) * np.clip(time_s[:, None], 0.0, 1.0) ** 3
    motion = oarlock.Motion.from_joints(time_s, dict(zip(names, q.T, strict=True)))
    return oarlock.track(model, oarlock.simulate(model, motion, seed=3)[1])


def test_one_iteration_is_the_plain_smoother(live):
    plain, once = oarlock.smooth(live), oarlock.smooth(live, iterations=1)
    assert np.array_equal(plain.q, once.q)
    assert np.array_equal(plain.q_std, once.q_std)
    assert "smoothing_iterations" not in once.provenance


def test_iterations_give_a_smoothed_track_and_leave_the_live_one(live):
    before = live.q.copy()
    shares: list[float] = []
    twice = oarlock.smooth(live, iterations=2, progress=shares.append)
    assert twice.smoothed
    assert twice.provenance["smoothing_iterations"] == 2
    assert np.isfinite(twice.q).all()
    assert not np.array_equal(twice.q, oarlock.smooth(live).q)
    assert np.array_equal(before, live.q)
    assert shares == sorted(shares)
    assert 0.5 < shares[-1] <= 1.0


def test_iterations_repeat_themselves_bit_for_bit(live):
    first, second = (oarlock.smooth(live, iterations=3) for _ in range(2))
    assert np.array_equal(first.q, second.q)
    assert np.array_equal(first.q_std, second.q_std)


def test_iterations_below_one_and_of_smoothed_tracks_are_refused(live):
    assert_refused(lambda: oarlock.smooth(live, iterations=0), "iterations = 0", "1 or more")
    assert_refused(lambda: oarlock.smooth(oarlock.smooth(live), iterations=2), "smoothed already")


def broad_trials() -> list[str]:
    return sorted(path.name for path in local_folder("data/broad").glob("*.mat"))


def assert_no_worse(live_deg: float, smoothed_deg: float, what: str) -> None:
    print(f"{what}: live {live_deg:.2f}, smoothed {smoothed_deg:.2f} deg")
    assert smoothed_deg <= max((1.0 + RELATIVE) * live_deg, live_deg + ABSOLUTE_DEG), what


def dfjimu_errors_deg(file: Path) -> list[float]:
    """Relative orientation of the two bodies: live, smoothed."""
    reference = read_dfjimu_reference(file)
    kept = reference.time_s > START_S
    estimates = ours.track_dfjimu(read_dfjimu(file))
    return [scores.rmse_deg(scores.relative_error_rad(e, reference, BODIES), kept) for e in estimates]


@pytest.mark.long
@pytest.mark.data
@pytest.mark.parametrize("trial", TRIALS)
def test_smoothed_two_bodies_are_no_worse_than_live(trial):
    live, smoothed = dfjimu_errors_deg(local_folder("data/dfjimu") / f"data_{trial}.mat")
    assert_no_worse(live, smoothed, trial)


@pytest.mark.long
@pytest.mark.data
def test_smoothed_single_units_are_no_worse_than_live():
    folder = local_folder("data/broad")
    for name in broad_trials():
        reference = read_broad_reference(folder / name)
        errors = [
            scores.rmse_deg(scores.attitude_error_rad(e, reference, BODY)[-1], reference.scored)
            for e in ours.track_broad(read_broad(folder / name))
        ]
        assert_no_worse(*errors, name)


@pytest.mark.long
@pytest.mark.data
@pytest.mark.parametrize("name", SIMULATED)
def test_smoothed_sculling_is_no_worse_than_live(name):
    model = oarlock.load_model("sculler")
    simulated = read_simulated(local_folder("recordings") / f"{name}.npz", name, model)
    live = oarlock.track(model, simulated.recording, simulated.nominal)
    errors = [angles(track, simulated.truth).mean_rmse_deg(ELEVEN) for track in (live, oarlock.smooth(live))]
    assert_no_worse(*errors, name)
