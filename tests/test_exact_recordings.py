"""Simulated sculling whose truth is known: errors, bands and innovations of the tree stay inside their bounds.

Bands must hold for strapdown links too, which are less exact: their units sit on skin.

Run with `-s` to see the measured figures.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import oarlock
from exact_recording import (
    ELEVEN,
    STRUCTURES,
    TREE,
    UNITS,
    Exact,
    Figures,
    at_rate,
    excerpt_track,
    figures,
    load_exact,
    load_excerpt,
    lossy,
    oars_as_states,
    sculler,
    silenced,
)

CONDITIONS = ("S-NB", "B-NB", "S-B", "B-B")

# What an independent filter reached on these recordings, with a margin of about a half.
MEAN_DEG, WORST_DEG = 0.03, 0.05
SEAT_MM = 0.8
RADIAL_DEG, PALMAR_DEG = 0.08, 0.7
OPEN_MEAN_DEG = 0.035
SMOOTH_MEAN_DEG = 0.015
BARE_MEAN_DEG = 0.025

NEES = (0.5, 1.5)
# Process noise is constant: gentle strokes have smaller innovations than it expects.
NIS = (0.7, 1.1)
# With 20 ms between readings the jerks of catches are larger than it expects: 1.29 of all units, below 0.9 of each.
SLOW_NIS = (0.7, 1.5)
COVERAGE = (0.93, 0.995)
HAND_COVERAGE = 0.93

LOST = 0.2
SILENT_S = 2.0
SLOW_HZ = 50.0

# The excerpt has 8 s behind the start instead of 38, and biases are still being learnt: errors may be larger by this.
SHORT = 1.5
# It holds the gentlest strokes and eight beliefs only: the lower bound on NEES gives way where little else bounds it.
SHORT_NEES = (0.35, 1.5)
# Until movement decides that there is no skin, bands of strapdown links are wider than errors of an exact body.
WIDE_NEES, WIDE_COVERAGE = (0.0, 1.5), (0.93, 1.0)


def of_forty_seconds(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.long(pytest.mark.data(test))


@cache
def tracked(condition: str, **config: object) -> oarlock.Track:
    settings = oarlock.Config(structure="tree", **config)
    return oarlock.track(sculler(), load_exact(condition).recording, config=settings)


def within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


def assert_consistent(
    found: Figures,
    *,
    nis: tuple[float, float] | None = NIS,
    nees: tuple[float, float] = NEES,
    coverage: tuple[float, float] = COVERAGE,
    hands: float = HAND_COVERAGE,
) -> None:
    assert within(found.nees, nees), f"NEES per state {found.nees:.3f}"
    assert within(found.whole_nees, nees), f"NEES of the whole state {found.whole_nees:.3f}"
    assert within(found.coverage, coverage), f"95 % bands hold {found.coverage:.2%}"
    assert found.hand_coverage >= hands, f"the hands' 95 % bands hold {found.hand_coverage:.2%}"
    assert nis is None or within(found.nis, nis), f"NIS per inertial reading {found.nis:.3f}"


def assert_small(found: Figures, times: float = 1.0) -> None:
    assert found.mean_deg <= times * MEAN_DEG
    assert found.worst_deg <= times * WORST_DEG
    assert found.seat_mm <= times * SEAT_MM


def assert_hands_small(found: Figures, times: float = 1.0) -> None:
    assert found.radial_deg <= times * RADIAL_DEG
    assert found.palmar_deg <= times * PALMAR_DEG


def spoilt(exact: Exact, unit: str, whole: bool) -> oarlock.Recording:
    """A fifth of all rows gone, and one unit silent for two seconds somewhere."""
    seed = 10 * UNITS.index(unit) + whole
    start_s = np.random.default_rng(seed).uniform(3.0, exact.truth.time_s[-1] - 2 * SILENT_S)
    return silenced(lossy(exact.recording, LOST, seed, whole), unit, start_s, SILENT_S)


@of_forty_seconds
@pytest.mark.parametrize("condition", CONDITIONS)
def test_errors_and_consistency(condition):
    found = figures(tracked(condition), load_exact(condition), condition)
    assert_small(found)
    assert_hands_small(found)
    assert_consistent(found)


@of_forty_seconds
@pytest.mark.parametrize("condition", CONDITIONS)
def test_smoothed(condition):
    found = figures(oarlock.smooth(tracked(condition)), load_exact(condition), f"{condition} smoothed")
    assert found.mean_deg <= SMOOTH_MEAN_DEG
    assert_consistent(found, nis=None)


@of_forty_seconds
@pytest.mark.parametrize("condition", CONDITIONS)
def test_without_closure(condition):
    track = tracked(condition, closures=False)
    scores = oarlock.evaluate(track, load_exact(condition).truth)
    mean_deg, coverage = scores.mean_rmse_deg(ELEVEN), scores.mean_coverage(ELEVEN)
    print(f"{condition} without closure: mean {mean_deg:.4f} deg, in 95 % band {coverage:.2%}")
    assert mean_deg <= OPEN_MEAN_DEG
    assert within(coverage, COVERAGE)


@of_forty_seconds
def test_without_slow_states():
    found = figures(tracked("S-NB", estimate=()), load_exact("S-NB"), "S-NB estimate=()")
    assert found.mean_deg <= BARE_MEAN_DEG
    assert_consistent(found)


@of_forty_seconds
def test_oars_as_states(tmp_path):
    exact = load_exact("B-B")
    found = figures(oarlock.track(oars_as_states(tmp_path), exact.recording), exact, "B-B oars as states")
    assert_small(found)
    assert_consistent(found)


@of_forty_seconds
@pytest.mark.parametrize("condition", ["S-NB", "B-B"])
@pytest.mark.parametrize("whole", [False, True], ids=["rows_lost", "samples_lost"])
@pytest.mark.parametrize("unit", UNITS)
def test_bands_hold_while_readings_are_missing(condition, unit, whole):
    exact = load_exact(condition)
    track = oarlock.track(sculler(), spoilt(exact, unit, whole), config=TREE)
    label = f"{condition} {'samples' if whole else 'rows'} lost, {unit} silent"
    assert_consistent(figures(track, exact, label), nis=None)


@of_forty_seconds
@pytest.mark.parametrize("condition", CONDITIONS)
def test_slower_sensors_need_no_other_tuning(condition):
    exact = load_exact(condition)
    recording = at_rate(exact.recording, SLOW_HZ)
    assert recording.streams[0].rate_hz == pytest.approx(SLOW_HZ, rel=0.3)
    slow = figures(
        oarlock.track(sculler(), recording, config=TREE), exact, f"{condition} at {SLOW_HZ:.0f} Hz"
    )
    assert_consistent(slow, nis=SLOW_NIS)


@pytest.mark.data
@pytest.mark.parametrize("condition", ["B-B"])
def test_generator_and_model_place_the_joints_alike(condition):
    assert_positions(load_exact(condition))


def assert_positions(exact: Exact) -> None:
    single_precision_m = 1e-6
    assert len(exact.positions_m) == 6
    for frame, expected in exact.positions_m.items():
        np.testing.assert_allclose(exact.truth.frame_positions(frame), expected, atol=single_precision_m)


def test_excerpt_places_the_joints_as_the_model_does():
    assert_positions(load_excerpt())


def test_excerpt_errors_and_consistency():
    found = figures(excerpt_track("tree"), load_excerpt(), "excerpt")
    assert_small(found, SHORT)
    assert_hands_small(found, SHORT)
    assert_consistent(found)


def test_excerpt_smoothed():
    found = figures(oarlock.smooth(excerpt_track("tree")), load_excerpt(), "excerpt smoothed")
    assert found.mean_deg <= SHORT * SMOOTH_MEAN_DEG
    assert_consistent(found, nis=None)


def test_excerpt_without_closure():
    exact = load_excerpt()
    track = oarlock.track(sculler(), exact.recording, config=oarlock.Config(structure="tree", closures=False))
    scores = oarlock.evaluate(track, exact.truth)
    print(f"excerpt without closure: mean {scores.mean_rmse_deg(ELEVEN):.4f} deg")
    assert scores.mean_rmse_deg(ELEVEN) <= SHORT * OPEN_MEAN_DEG


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("unit", UNITS)
def test_excerpt_bands_hold_while_readings_are_missing(unit, structure):
    exact, config = load_excerpt(), oarlock.Config(structure=structure)
    track = oarlock.track(sculler(), spoilt(exact, unit, False), config=config)
    nees, coverage = (SHORT_NEES, COVERAGE) if structure == "tree" else (WIDE_NEES, WIDE_COVERAGE)
    found = figures(track, exact, f"excerpt {unit} silent, {structure}")
    # While a forearm is silent its hand, which has no unit, is off by up to 56 deg for a second: 91 % measured.
    hands = 0.88 if structure == "strapdown" and "forearm" in unit else HAND_COVERAGE
    assert_consistent(found, nis=None, nees=nees, coverage=coverage, hands=hands)


def test_excerpt_at_half_the_rate():
    exact = load_excerpt()
    track = oarlock.track(sculler(), at_rate(exact.recording, SLOW_HZ), config=TREE)
    assert_consistent(figures(track, exact, "excerpt at 50 Hz"))


def test_excerpt_with_oars_as_states(tmp_path):
    exact, model = load_excerpt(), oars_as_states(tmp_path)
    track = oarlock.track(model, exact.recording)
    found = figures(track, exact, "excerpt, oars as states")
    assert found.mean_deg <= SHORT * MEAN_DEG
    assert_consistent(found, nees=SHORT_NEES)
    oars = [name for name in model.joint_names if "oar_" in name]
    assert {name for name in oars if track[name].observed.all()} == {n for n in oars if "theta" not in n}
    assert any(note.startswith("r_oar_theta: not observed") for note in track.notes)
