"""State estimates pickled by this version and by others."""

import pickle

import numpy as np
import pytest

import oarlock
from exact_recording import excerpt_track

PLACE_OF_MEMORY = 9


@pytest.fixture(scope="module")
def belief() -> oarlock.Belief:
    belief = excerpt_track().last_belief
    assert belief is not None
    return belief


def test_a_belief_comes_back_from_a_pickle(belief):
    loaded = pickle.loads(pickle.dumps(belief))
    assert np.array_equal(loaded.mean, belief.mean)
    assert np.array_equal(loaded.memory, belief.memory, equal_nan=True)


@pytest.mark.parametrize("more", [-1, 1])
def test_a_belief_of_another_version_is_refused(belief, more):
    build, parts = belief.__reduce__()
    memory = [[*numbers, 0.0][: len(numbers) + more] for numbers in belief.memory]
    with pytest.raises(oarlock.DataError, match="read it with the version that wrote it"):
        build(*parts[:PLACE_OF_MEMORY], memory, *parts[PLACE_OF_MEMORY + 1 :])


@pytest.mark.parametrize("more", [-1, 1])
def test_a_belief_with_another_layout_of_its_links_is_refused(belief, more):
    build, parts = belief.__reduce__()
    with pytest.raises(oarlock.DataError, match=r"links: .* read it with the version that wrote it"):
        build(*parts[:-1], [*belief.links, 0.0][: len(belief.links) + more])
