"""The soak, short: devices that vanish, return, restart their clocks, send rubbish and swap addresses."""

import pytest

from oarlock_lab.soak.checks import events_of_plan, growth_percent
from oarlock_lab.soak.misbehaving import planted
from oarlock_lab.soak.soak import soak_virtual, summary


@pytest.mark.parametrize(
    ("seconds", "rate_hz"),
    [(64.0, 20.0), pytest.param(330.0, 50.0, marks=pytest.mark.long)],
    ids=["a minute", "five minutes"],
)
def test_a_session_tells_what_goes_wrong_and_its_recording_gives_its_estimates(tmp_path, seconds, rate_hz):
    found = soak_virtual(tmp_path / "session", seconds, rate_hz)
    assert not found.problems, summary("soak", found)
    count = len(planted(seconds))
    assert found.figures["planted events in the log"] == f"{count} of {count}"
    # Silence is told after 0.7 s, with a look each 0.5 s; a clock is known to be set by its first reading.
    assert found.figures["longest time until one was in the log, s"] < 1.6
    assert found.figures["estimates"] > 0.9 * rate_hz * (seconds - 10.0)


def test_an_event_that_is_missing_or_told_too_late_is_found():
    plan = planted(64.0)
    events = [{"time_s": one.at_s + 1.0, "text": " ".join(one.words)} for one in plan]
    assert events_of_plan(plan, events).missing == ()
    assert events_of_plan(plan, events[1:]).missing == (plan[0],)
    late = [{**events[0], "time_s": plan[0].at_s + 30.0}, *events[1:]]
    assert events_of_plan(plan, late).missing == (plan[0],)
    more = events_of_plan(plan, [*events, {"time_s": 20.0, "text": "something else"}])
    assert (more.missing, more.others) == ((), ("something else",))


def test_growth_counts_from_behind_the_warm_up():
    rising = [(float(k), 1000 + max(k - 20, 0)) for k in range(100)]
    assert growth_percent([(float(k), 500 if k < 20 else 1000) for k in range(100)]) == 0.0
    assert 5.0 < growth_percent(rising) < 7.0
