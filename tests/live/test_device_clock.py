"""Clocks of devices from arrivals: simulated senders with known offset and drift."""

import numpy as np
import pytest

from oarlock.live.clock import RESTART_S, SLEW, DeviceClock

RATE_HZ, LEAST_S = 100.0, 2e-3


def sent(seed, seconds, ppm, *, queue_s=8e-3, event_s=0.0, stalls=3):
    """Times of measurement by this machine, the device's stamps, and arrivals in the order of sending."""
    rng = np.random.default_rng(seed)
    true_s = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    arrival_s = true_s + LEAST_S + rng.exponential(queue_s, len(true_s))
    if event_s:
        phase_s = rng.uniform(0, event_s)
        arrival_s = np.ceil((arrival_s - phase_s) / event_s) * event_s + phase_s
    for stall_s in rng.uniform(0, seconds, stalls):
        arrival_s[(arrival_s > stall_s) & (arrival_s < stall_s + 0.4)] = stall_s + 0.4
    return true_s, 123.4 + true_s * (1 + 1e-6 * ppm), np.maximum.accumulate(arrival_s)


def used(clock, clock_s, arrival_s):
    times = [clock.time_s(*pair) for pair in zip(clock_s, arrival_s, strict=True)]
    return np.array([np.nan if time_s is None else time_s for time_s in times])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("ppm", [-150, 0, 50])
def test_offset_and_drift_from_the_fastest_readings(seed, ppm):
    true_s, clock_s, arrival_s = sent(seed, 300, ppm)
    clock = DeviceClock()
    off_s = used(clock, clock_s, arrival_s) - true_s - LEAST_S
    assert np.isnan(off_s[true_s < 1.9]).all() and np.isfinite(off_s[true_s > 2.5]).all()
    # Of 500 readings in 5 s the fastest has waited 0.02 ms; plain means of arrivals are late by 8 ms.
    assert np.abs(off_s[true_s > 60]).max() < 1e-3
    assert np.abs(off_s[true_s > 2.5]).max() < 3e-3
    assert clock.drift == pytest.approx(-1e-6 * ppm, abs=5e-6)
    assert clock.restarts == 0


def test_it_is_slewed_and_never_stepped():
    _, clock_s, arrival_s = sent(5, 120, 80, event_s=0.03, stalls=8)
    time_s = used(DeviceClock(), clock_s, arrival_s)
    known = np.isfinite(time_s)
    moved_s = np.abs(np.diff((time_s - clock_s)[known]))
    assert (moved_s <= SLEW * np.diff(arrival_s[known]) + 1e-12).all()
    assert (np.diff(time_s[known]) > 0).all()


@pytest.mark.parametrize("jump_s", [-50.0, 0.5, 3000.0])
def test_a_clock_that_is_set_starts_anew_without_a_wrong_time(jump_s):
    true_s, clock_s, arrival_s = sent(7, 60, 20, stalls=0)
    clock_s[3000:] += jump_s
    clock = DeviceClock()
    time_s = used(clock, clock_s, arrival_s)
    assert clock.restarts == 1
    known = np.isfinite(time_s)
    assert not known[3000:3190].any() and known[3210:].all()
    assert np.abs(time_s - true_s - LEAST_S)[known].max() < 3e-3


def test_a_clock_that_stood_still_starts_anew():
    true_s, clock_s, arrival_s = sent(8, 60, 0, stalls=0)
    clock_s[3000:] -= 2 * RESTART_S
    clock = DeviceClock()
    time_s = used(clock, clock_s, arrival_s)
    assert clock.restarts == 1
    assert np.abs(time_s - true_s - LEAST_S)[-1000:].max() < 3e-3


def test_readings_out_of_order_keep_their_own_times():
    true_s, clock_s, arrival_s = sent(9, 20, 0, stalls=0)
    order = np.arange(len(clock_s)).reshape(-1, 4)[:, [1, 0, 3, 2]].ravel()
    together_s = arrival_s.reshape(-1, 4)[:, [1, 1, 3, 3]].ravel()
    time_s = used(DeviceClock(), clock_s[order], together_s)
    known = np.isfinite(time_s)
    assert np.abs(time_s - true_s[order] - LEAST_S)[known].max() < 3e-3
