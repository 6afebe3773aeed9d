"""Clocks of devices from arrivals: simulated senders with known offset and drift."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oarlock.live.clock import LARGEST_SLEW, RESTART_S, DeviceClock
from oarlock.live.decoders.wrapping import Wrapping

RATE_HZ, LEAST_S = 100.0, 2e-3


class Sent(NamedTuple):
    """Times of measurement by this machine, the device's stamps, and arrivals in the order of sending."""

    true_s: np.ndarray
    clock_s: np.ndarray
    arrival_s: np.ndarray


def sent(seed, seconds, ppm, *, queue_s=8e-3, tail=None, burst=1, loss=0.0, event_s=0.0, stalls=3):
    """Exponential queues, or, with a `tail`, Pareto's of this index; stalls of this machine last 0.4 s."""
    rng = np.random.default_rng(seed)
    true_s = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    last = np.minimum((np.arange(len(true_s)) // burst + 1) * burst, len(true_s)) - 1
    size = len(true_s)
    queued_s = rng.exponential(queue_s, size) if tail is None else queue_s * rng.pareto(tail, size)
    arrival_s = true_s[last] + LEAST_S + queued_s[last]
    if event_s:
        phase_s = rng.uniform(0, event_s)
        arrival_s = np.ceil((arrival_s - phase_s) / event_s) * event_s + phase_s
    for stall_s in rng.uniform(0, seconds, stalls):
        arrival_s[(arrival_s > stall_s) & (arrival_s < stall_s + 0.4)] = stall_s + 0.4
    kept = rng.random(size) >= loss
    return Sent(
        true_s[kept], (123.4 + true_s * (1 + 1e-6 * ppm))[kept], np.maximum.accumulate(arrival_s)[kept]
    )


def used(clock, one):
    """Times by this machine, NaN for readings that got none, and when each was given."""
    time_s, given_s = np.full(len(one.clock_s), np.nan), np.full(len(one.clock_s), np.nan)
    for row, (clock_s, arrival_s) in enumerate(zip(one.clock_s, one.arrival_s, strict=True)):
        for what, at_s in clock.take(clock_s, arrival_s, row):
            time_s[what], given_s[what] = at_s, arrival_s
    for what, at_s in clock.flush():
        time_s[what], given_s[what] = at_s, one.arrival_s[-1]
    return time_s, given_s


def errors(clock, one):
    return used(clock, one)[0] - one.true_s - LEAST_S


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("ppm", [-150, 0, 50])
def test_offset_and_drift_from_the_fastest_readings(seed, ppm):
    one, clock = sent(seed, 300, ppm), DeviceClock()
    off_s = errors(clock, one)
    assert np.isfinite(off_s).all()
    # Of 500 readings in 5 s the fastest has waited 0.02 ms; plain means of arrivals are late by 8 ms.
    assert np.abs(off_s[one.true_s > 60]).max() < 1e-3
    assert np.abs(off_s[one.true_s > 2.5]).max() < 3e-3
    assert clock.drift == pytest.approx(-1e-6 * ppm, abs=5e-6)
    assert clock.restarts == 0


@pytest.mark.parametrize(
    ("tail", "ppm", "first_s", "later_s", "settled_s"),
    [(None, 50, 4e-3, 1e-3, 5e-4), (None, 200, 4e-3, 4e-3, 5e-4), (1.5, 50, 8e-3, 2e-3, 1e-3)],
)
def test_errors_with_jitter_bursts_and_loss(tail, ppm, first_s, later_s, settled_s):
    """10 ms of jitter, bursts of three, 3 % lost; of ten senders the worst reading."""
    for seed in range(10):
        one, clock = (
            sent(seed, 120, ppm, queue_s=10e-3, tail=tail, burst=3, loss=0.03, stalls=0),
            DeviceClock(),
        )
        off_s = np.abs(errors(clock, one))
        assert off_s.max() < first_s
        assert off_s[one.true_s > 5].max() < later_s
        assert off_s[one.true_s > 60].max() < settled_s
        assert clock.restarts == 0


def test_it_is_slewed_and_never_stepped():
    one = sent(5, 120, 80, event_s=0.03, stalls=8)
    time_s, _ = used(DeviceClock(), one)
    moved_s = np.abs(np.diff(time_s - one.clock_s))
    assert (moved_s <= LARGEST_SLEW * np.diff(one.arrival_s) + 1e-12).all()
    assert (np.diff(time_s) > 0).all()


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    ppm=st.floats(-200, 200),
    stalls=st.lists(st.tuples(st.floats(1.0, 25.0), st.floats(0.05, 6.0)), max_size=4),
    tail=st.sampled_from([None, 1.5, 3.0]),
    burst=st.integers(1, 5),
)
def test_nothing_that_is_only_late_is_lost_or_moved(seed, ppm, stalls, tail, burst):
    one = sent(seed, 30, ppm, tail=tail, burst=burst, loss=0.03, stalls=0)
    for begun_s, lasts_s in stalls:
        held = (one.arrival_s > begun_s) & (one.arrival_s < begun_s + lasts_s)
        one.arrival_s[held] = begun_s + lasts_s
    clock = DeviceClock()
    off_s = errors(clock, one._replace(arrival_s=np.maximum.accumulate(one.arrival_s)))
    assert np.isfinite(off_s).all()
    assert clock.restarts == 0
    # The first offset has the least of 0.4 s; a queue of the index 1.5 has no variance.
    assert np.abs(off_s).max() < (0.05 if tail == 1.5 else 0.025)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), late_s=st.floats(0.3, 3.0))
def test_a_machine_that_is_busy_at_the_start_is_no_clock_that_was_set(seed, late_s):
    one = sent(seed, 20, 50, stalls=0)
    clock = DeviceClock()
    off_s = errors(clock, one._replace(arrival_s=np.maximum(one.arrival_s, late_s)))
    assert clock.restarts == 0
    assert np.isfinite(off_s).all()
    assert np.abs(off_s[one.true_s > late_s + 3.0]).max() < 5e-3


@pytest.mark.parametrize("jump_s", [-5000.0, -50.0, -1.5, 0.5, 3000.0, 7200.0])
def test_a_clock_that_is_set_starts_anew_without_a_wrong_time(jump_s):
    one = sent(7, 60, 20, stalls=0)
    one.clock_s[3000:] += jump_s
    clock = DeviceClock()
    time_s, given_s = used(clock, one)
    assert clock.restarts == 1
    assert np.abs(time_s - one.true_s - LEAST_S).max() < 3e-3
    # A tracker goes back by up to 0.5 s, so that it uses all of them.
    assert (given_s - time_s).max() < 0.5


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    jump_s=st.one_of(st.floats(-1e5, -1.2), st.floats(0.4, 1e5)),
    row=st.integers(60, 2400),
)
def test_any_clock_that_is_set_has_right_times_before_and_after(seed, jump_s, row):
    one = sent(seed, 30, 50, queue_s=10e-3, burst=3, stalls=0)
    one.clock_s[row:] += jump_s
    clock = DeviceClock()
    off_s = errors(clock, one)
    assert clock.restarts == 1
    assert np.isfinite(off_s).all()
    assert np.abs(off_s).max() < 0.02


def test_a_clock_that_stood_still_starts_anew():
    one = sent(8, 60, 0, stalls=0)
    one.clock_s[3000:] -= 2 * RESTART_S
    clock = DeviceClock()
    off_s = errors(clock, one)
    assert clock.restarts == 1
    assert np.abs(off_s).max() < 3e-3


def test_all_senders_that_are_late_together_keep_their_clocks():
    """This machine is half a second behind for four seconds: a clock alone would look as if it had paused."""
    one = sent(8, 30, 0, stalls=0)
    behind = (one.true_s > 10) & (one.true_s < 14)
    arrival_s = np.maximum.accumulate(one.arrival_s + np.where(behind, 0.5, 0.0))
    alone = DeviceClock()
    used(alone, one._replace(arrival_s=arrival_s))
    assert alone.restarts > 0
    first, second = DeviceClock(), DeviceClock()
    first.are_others_late = lambda: second.is_late
    second.are_others_late = lambda: first.is_late
    both = [(first, []), (second, [])]
    for row, (clock_s, at_s) in enumerate(zip(one.clock_s, arrival_s, strict=True)):
        for clock, found in both:
            found += clock.take(clock_s, at_s, row)
    for clock, found in both:
        assert clock.restarts == 0
        off_s = [time_s - one.true_s[what] - LEAST_S for what, time_s in found]
        assert len(found) == len(one.clock_s)
        assert np.abs(off_s).max() < 3e-3


def test_a_damaged_stamp_moves_nothing():
    one, clock = sent(12, 20, 0, stalls=0), DeviceClock()
    wrong = [500, 900, 901, 1500]
    one.clock_s[wrong] += [4295.0, 7.0, 70.0, 3.0]
    off_s = errors(clock, one)
    right = np.setdiff1d(np.arange(len(off_s)), wrong)
    assert clock.restarts == 0
    assert np.isnan(off_s[wrong]).all()
    assert np.abs(off_s[right]).max() < 3e-3


@pytest.mark.parametrize("asleep_s", [40.0, 600.0])
def test_a_device_that_slept_goes_on(asleep_s):
    one, clock = sent(13, asleep_s + 60, 30, stalls=0), DeviceClock()
    awake = (one.true_s < 30) | (one.true_s > 30 + asleep_s)
    one = Sent(*(rows[awake] for rows in one))
    off_s = np.abs(errors(clock, one))
    assert clock.restarts == 0
    # After 10 minutes a drift of 30 ppm, known to 5 ppm, is 3 ms.
    assert off_s.max() < 6e-3
    assert off_s[-1000:].max() < 2e-3


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), bits=st.sampled_from([8, 16, 32]), at=st.floats(0.0, 1.0))
def test_registers_that_wrap_have_the_times_of_those_that_do_not(seed, bits, at):
    """A register of ticks; the smallest wraps every 2.56 s."""
    register, tick_s = 2**bits, {8: 0.01, 16: 1e-3, 32: 1e-6}[bits]
    one = sent(seed, 30, 0, loss=0.03, stalls=1)
    ticks = np.round(one.true_s / tick_s).astype(int) + int(at * register)
    unwrap = Wrapping(register)
    clock_s = np.array([unwrap.unwrapped(int(tick) % register) for tick in ticks]) * tick_s
    clock = DeviceClock()
    off_s = errors(clock, one._replace(clock_s=clock_s))
    assert clock.restarts == 0
    assert np.abs(off_s).max() < 0.02


@pytest.mark.parametrize("warms_ppm", [10.0, 20.0])
def test_a_crystal_that_warms_up(warms_ppm):
    """Its rate changes over five minutes."""
    one, clock = sent(14, 900, 0, stalls=0), DeviceClock()
    warmed = one.true_s - 300.0 * (1.0 - np.exp(-one.true_s / 300.0))
    off_s = errors(clock, one._replace(clock_s=one.clock_s + 1e-6 * warms_ppm * warmed))
    assert np.abs(off_s[one.true_s > 30]).max() < 2e-3


def test_a_way_that_becomes_faster_or_slower_is_followed():
    one, clock = sent(15, 120, 0, stalls=0), DeviceClock()
    slower = (one.true_s > 40) & (one.true_s < 80)
    time_s, _ = used(clock, one._replace(arrival_s=one.arrival_s + np.where(slower, 0.06, 0.0)))
    off_s = time_s - one.true_s - LEAST_S
    assert clock.restarts == 0
    assert (np.diff(time_s) > 0).all()
    assert np.abs(off_s[(one.true_s > 75) & slower] - 0.06).max() < 5e-3
    assert np.abs(off_s[one.true_s > 110]).max() < 5e-3


def test_readings_out_of_order_keep_their_own_times():
    one = sent(9, 20, 0, stalls=0)
    order = np.arange(len(one.clock_s)).reshape(-1, 4)[:, [1, 0, 3, 2]].ravel()
    together_s = one.arrival_s.reshape(-1, 4)[:, [1, 1, 3, 3]].ravel()
    assert np.abs(errors(DeviceClock(), Sent(one.true_s[order], one.clock_s[order], together_s))).max() < 3e-3


def test_rare_readings_settle_with_the_first_one_after_two_seconds():
    one, clock = sent(16, 60, 0, stalls=0), DeviceClock()
    time_s, given_s = used(clock, Sent(*(rows[::100] for rows in one)))
    assert np.isfinite(time_s).all()
    assert np.abs(time_s - one.true_s[::100] - LEAST_S).max() < 0.03
    assert given_s[0] < 3.1


def test_the_same_readings_give_the_same_bits():
    one = sent(17, 60, 70, queue_s=10e-3, burst=3, loss=0.03, stalls=5)
    first, second = (used(DeviceClock(), one)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)
