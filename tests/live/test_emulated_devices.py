"""Every emulated device that measures a movement gives, decoded and tracked live, the angles of the offline track."""

from dataclasses import dataclass

import pytest

from oarlock_lab.emulators.kinds import KINDS
from oarlock_lab.emulators.swinging import swinging
from oarlock_lab.soak.loopback import FAULTY, PERFECT, compared, emulated_by, pendulum_with


@dataclass(frozen=True)
class Case:
    """A kind, and the sensors of the pendulum's links that it stands for."""

    kind: str
    sensor: str = "imu"

    def __str__(self):
        return self.kind if self.sensor == "imu" else f"{self.kind}-{self.sensor}"


CASES = [
    *(Case(name) for name, kind in KINDS.items() if "imu" in kind.streams),
    *(Case(name, "orientation") for name, kind in KINDS.items() if "orientation" in kind.streams),
    *(Case(name, "position") for name, kind in KINDS.items() if "vector" in kind.streams),
]


@pytest.fixture(scope="module")
def pendulums(pendulum, tmp_path_factory):
    """The pendulum with other sensors on its links, by their kind."""
    folder = tmp_path_factory.mktemp("models")
    return {"imu": pendulum} | {kind: pendulum_with(kind, folder) for kind in ("orientation", "position")}


def loop(pendulums, case, faults):
    model = pendulums[case.sensor]
    truth, recording = swinging(model, KINDS[case.kind].rate_hz, seed=2)
    return compared(*emulated_by(case.kind, recording, faults), model, truth)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_with_perfect_clocks_the_angles_are_those_of_the_offline_track(pendulums, case):
    found = loop(pendulums, case, PERFECT)
    assert found.difference_deg < 0.1


@pytest.mark.parametrize("case", CASES, ids=str)
def test_with_faults_the_error_grows_by_a_fifth_at_most(pendulums, case):
    found = loop(pendulums, case, FAULTY)
    assert found.live_deg < 1.2 * found.offline_deg
