"""Every emulated device that measures a movement gives, decoded and tracked live, the angles of the offline track."""

import pytest
from loopback import FAULTY, PERFECT, compared, emulated_by

import oarlock
from oarlock.live.emulators.kinds import KINDS
from oarlock.live.emulators.swinging import swinging

MEASURING = [name for name, kind in KINDS.items() if kind.streams]


@pytest.fixture(scope="module")
def pendulum():
    return oarlock.load_model("pendulum3")


def moved(model, name):
    return swinging(model, KINDS[name].rate_hz, seed=2)


@pytest.mark.parametrize("name", MEASURING)
def test_with_perfect_clocks_the_angles_are_those_of_the_offline_track(pendulum, name):
    truth, recording = moved(pendulum, name)
    found = compared(*emulated_by(name, recording, PERFECT), pendulum, truth)
    print(name, found)
    assert found.difference_deg < 0.1


@pytest.mark.parametrize("name", MEASURING)
def test_with_faults_the_error_grows_by_a_fifth_at_most(pendulum, name):
    truth, recording = moved(pendulum, name)
    found = compared(*emulated_by(name, recording, FAULTY), pendulum, truth)
    print(name, found)
    assert found.live_deg < 1.2 * found.offline_deg
