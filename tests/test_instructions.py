"""Instructions of a step, counted by callgrind: at most those of the record, and every step alike."""

import json

import pytest

from oarlock_lab.bench import counted

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def now() -> counted.Counts:
    try:
        return counted.counts()
    except counted.NotCounted as e:
        pytest.skip(str(e))


def test_a_step_takes_no_more_instructions_than_in_the_last_release(now: counted.Counts) -> None:
    record = json.loads(counted.RECORD.read_text(encoding="utf-8"))
    if record["compiler"] != counted.compiler():
        pytest.skip(f"the record was made by {record['compiler']}, this is {counted.compiler()}")
    assert now.keys() == record["bodies"].keys()
    assert counted.grown(now, record["bodies"]) == {}


def test_no_step_takes_much_longer_than_the_others(now: counted.Counts) -> None:
    for body, each in now.items():
        assert each["p99"] <= counted.MAX_TAIL * each["median"], body


def test_growth_beyond_the_limit_is_named() -> None:
    before = {"a": {"median": 100.0}, "b": {"median": 100.0}}
    now = {"a": {"median": 106.0}, "b": {"median": 104.0}, "new": {"median": 1.0}}
    assert counted.grown(now, before) == {"a": {"before": 100.0, "now": 106.0}}
