"""Gaps are found, filled or refused, and told; the low-pass has no delay and the cut-off that it says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oarlock import DataError
from oarlock.markers import Markers, fill_gaps, low_pass

RATE_HZ = 100.0
EXACT_FILL_M = 1e-3  # a hand's path through 200 ms: what a spline does not know of it
NOISY_FILL_M = 8e-3  # the same from neighbours with 1 mm of noise: 5 to 7 times that noise in the middle
CUTOFF = 1e-3  # of an amplitude: what the ends of a finite signal still change


def path(seconds: float = 6.0, noise_m: float = 0.0) -> Markers:
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    x = np.stack([0.3 * np.sin(2 * np.pi * 0.5 * t), 0.1 * np.cos(2 * np.pi * 1.1 * t), 0.2 * t], axis=1)
    return Markers(("hand",), t, (x + noise_m * np.random.default_rng(0).standard_normal(x.shape))[:, None])


def lose(markers: Markers, *spans: tuple[int, int]) -> Markers:
    position = np.array(markers.position_m)
    for first, last in spans:
        position[first:last] = np.nan
    return Markers(markers.names, markers.time_s, position)


@pytest.mark.parametrize(("noise_m", "tolerance"), [(0.0, EXACT_FILL_M), (1e-3, NOISY_FILL_M)])
def test_short_gaps_are_filled_and_flagged(noise_m, tolerance):
    whole = path()
    filled = fill_gaps(lose(path(noise_m=noise_m), (100, 120), (300, 305)))
    assert [(gap.start_s, gap.frames, gap.filled) for gap in filled.gaps] == [(1.0, 20, True), (3.0, 5, True)]
    assert filled.gaps[0].duration_s == pytest.approx(0.2)
    np.testing.assert_array_equal(
        np.flatnonzero(filled.estimated[:, 0]), [*range(100, 120), *range(300, 305)]
    )
    away = np.linalg.norm(filled.markers.position_m - whole.position_m, axis=2)[filled.estimated]
    assert away.max() < tolerance
    assert not filled.std_m[filled.markers.seen & ~filled.estimated].any()


def test_what_was_put_in_is_as_good_as_its_standard_deviation_says():
    whole, noisy = path(60.0), path(60.0, noise_m=1e-3)
    filled = fill_gaps(lose(noisy, *((first, first + 20) for first in range(60, 5900, 60))))
    away = (filled.markers.position_m - whole.position_m)[filled.estimated]
    share = np.sqrt(np.mean((away / filled.std_m[filled.estimated][:, None]) ** 2))
    assert 0.5 < share < 1.2, "1 if paths were driven by white jerk; smooth ones are a little better"
    middle, edge = filled.std_m[70, 0], filled.std_m[60, 0]
    assert edge < 1.5e-3 < middle, "about the noise beside a seen frame, more in the middle"


def test_a_parabola_is_continued_exactly_and_a_still_marker_stays():
    t = np.arange(0.0, 1.0, 1.0 / RATE_HZ)
    throw = np.stack([2.0 * t, 1.0 + 3.0 * t - 4.9 * t**2, 0.0 * t], axis=1)
    whole = Markers(("ball", "floor"), t, np.stack([throw, np.full((100, 3), 0.25)], axis=1))
    filled = fill_gaps(lose(whole, (40, 55)))
    np.testing.assert_allclose(filled.markers.position_m, whole.position_m, atol=1e-9)
    assert filled.estimated[40:55].all()


def test_what_cannot_be_filled_is_left_and_said():
    holes = lose(path(), (0, 10), (200, 221), (300, 302), (303, 310), (311, 312), (590, 600))
    filled = fill_gaps(holes, longest_s=0.2)
    reasons = {round(gap.start_s, 2): gap.reason for gap in filled.refused}
    assert reasons == {0.0: "at the start", 2.0: "longer than 0.2 s", 5.9: "at the end"}
    assert not filled.markers.seen[200:221].any()
    assert filled.markers.seen[300:312].all()
    np.testing.assert_array_equal(filled.markers.position_m[holes.seen], holes.position_m[holes.seen])


def test_too_few_neighbours_are_no_ground_for_a_spline():
    filled = fill_gaps(lose(path(0.5), (2, 6), (10, 50)), longest_s=0.2)
    assert [gap.reason for gap in filled.gaps] == ["only 2 frames seen before it", "at the end"]


def test_a_marker_never_seen_is_one_gap():
    gaps = fill_gaps(lose(path(), (0, 600))).gaps
    assert [(gap.frames, gap.reason) for gap in gaps] == [(600, "never seen")]


@settings(max_examples=30, deadline=None)
@given(missing=st.lists(st.booleans(), min_size=30, max_size=30), longest_s=st.sampled_from([0.0, 0.05, 0.2]))
def test_filling_never_moves_what_was_seen_and_reports_every_missing_frame(missing, longest_s):
    whole = path(0.3)
    position = np.array(whole.position_m)
    position[np.array(missing)] = np.nan
    holes = Markers(whole.names, whole.time_s, position)
    filled = fill_gaps(holes, longest_s)
    np.testing.assert_array_equal(filled.markers.position_m[holes.seen], holes.position_m[holes.seen])
    assert sum(gap.frames for gap in filled.gaps) == sum(missing)
    assert sum(gap.frames for gap in filled.gaps if gap.filled) == filled.estimated.sum()
    assert all(gap.duration_s <= longest_s + 0.5 / RATE_HZ for gap in filled.gaps if gap.filled)


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("rate_hz", [50.0, 250.0])
def test_low_pass_halves_the_power_at_its_cut_off_and_delays_nothing(order, rate_hz):
    t = np.arange(0.0, 8.0, 1.0 / rate_hz)
    middle = slice(len(t) // 4, -len(t) // 4)
    for frequency, gain in ((10.0, np.sqrt(0.5)), (1.0, None)):
        wave = np.sin(2 * np.pi * frequency * t)
        markers = Markers(("a",), t, np.repeat(wave[:, None, None], 3, axis=2))
        passed = low_pass(markers, 10.0, order)["a"][middle, 0]
        expected = wave[middle] * (
            gain if gain is not None else np.linalg.norm(passed) / np.linalg.norm(wave[middle])
        )
        np.testing.assert_allclose(passed, expected, atol=CUTOFF)


def test_low_pass_works_between_gaps_only():
    markers = lose(path(noise_m=1e-3), (200, 260), (261, 300))
    passed = low_pass(markers)
    np.testing.assert_array_equal(passed.seen, markers.seen)
    np.testing.assert_array_equal(passed.position_m[260], markers.position_m[260])
    alone = low_pass(markers.between(3.0, 5.99))
    np.testing.assert_array_equal(passed.position_m[300:], alone.position_m)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cutoff_hz": 45.0}, "Lower the cut-off to 40 Hz"),
        ({"order": 3}, "order = 3"),
        ({"cutoff_hz": -1.0}, "positive"),
    ],
)
def test_low_pass_refuses(change, said):
    with pytest.raises(DataError, match=said):
        low_pass(path(), **change)


def test_low_pass_refuses_dropped_frames():
    whole = path()
    kept = np.delete(np.arange(600), [200, 201])
    with pytest.raises(DataError, match="even time stamps"):
        low_pass(Markers(("hand",), whole.time_s[kept], whole.position_m[kept]))
