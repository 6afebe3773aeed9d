"""State estimates pickled by this version, an earlier and a later one."""

import pickle

import numpy as np
import pytest

import oarlock
from exact_recording import excerpt_track

EARLIER_MEMORY = 35  # numbers of a source in version 0.1.0
PLACE_OF_MEMORY = 9


@pytest.fixture(scope="module")
def belief() -> oarlock.Belief:
    belief = excerpt_track().last_belief
    assert belief is not None
    return belief


def with_memory(belief: oarlock.Belief, memory: list[list[float]]) -> oarlock.Belief:
    build, parts = belief.__reduce__()
    return build(*parts[:PLACE_OF_MEMORY], memory, *parts[PLACE_OF_MEMORY + 1 :])


def test_a_belief_comes_back_from_a_pickle(belief):
    loaded = pickle.loads(pickle.dumps(belief))
    assert np.array_equal(loaded.mean, belief.mean)
    assert np.array_equal(loaded.memory, belief.memory, equal_nan=True)


def test_what_an_earlier_version_did_not_remember_is_as_before_the_first_reading(belief):
    loaded = with_memory(belief, [numbers[:EARLIER_MEMORY] for numbers in belief.memory])
    read, ours = np.array(loaded.memory), np.array(belief.memory)
    assert np.array_equal(read[:, :EARLIER_MEMORY], ours[:, :EARLIER_MEMORY], equal_nan=True)
    assert np.isnan(read[:, EARLIER_MEMORY:]).all()
    assert np.isfinite(ours[:, EARLIER_MEMORY:]).any(), "magnetometers remember more now"


def test_a_belief_of_a_later_version_is_refused_by_name(belief):
    with pytest.raises(oarlock.DataError, match="newer version of Oarlock"):
        with_memory(belief, [[*numbers, 0.0] for numbers in belief.memory])
