"""Settings of all tests and what several files use: made once by each worker of a parallel run."""

import gc
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

import exact_recording
import oarlock
import season_places
from oarlock.rowing import SIMULATORS

# A deadline would fail on a busy machine.
settings.register_profile("oarlock", deadline=None)
settings.load_profile("oarlock")

# A run in the background of a shell ignores Ctrl-C, and with it every process that a test stops by it.
signal.signal(signal.SIGINT, signal.default_int_handler)

RUN = pytest.StashKey[frozenset[str]]()


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """Without a search for garbage, which is a third of the time: modules and items stay until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish(session: pytest.Session) -> None:
    """Keep what is run without workers."""
    session.config.stash[RUN] = frozenset(item.nodeid for item in session.items)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_node_collection_finished(node: Any, ids: list[str]) -> None:
    """Keep what is run by workers, each of which collects all."""
    node.config.stash[RUN] = frozenset(ids)


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say how many functions were run: parametrised items look like more tests than anybody wrote."""
    items = config.stash.get(RUN, frozenset())
    functions = {item.partition("[")[0] for item in items}
    terminalreporter.write_line(f"{len(functions)} test functions, {len(items)} with their parameters")


@pytest.fixture(scope="session")
def sculler() -> oarlock.Model:
    """The shipped sculler."""
    return exact_recording.sculler()


@pytest.fixture(scope="session")
def four_seconds(sculler: oarlock.Model) -> oarlock.studies.StudyTrial:
    """A trial of the simulator of sculling as its defaults are."""
    values = {name: key.default for name, key in SIMULATORS["sculling"].keys(sculler).items()}
    return SIMULATORS["sculling"].trial(sculler, values | {"duration_s": 4.0}, 5)


@pytest.fixture(scope="session")
def pendulum() -> oarlock.Model:
    """The shipped pendulum: a body without oars."""
    return oarlock.load_model("pendulum3")


@pytest.fixture(scope="session")
def pendulum_motion(pendulum: oarlock.Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a motion of the pendulum."""
    time_s = np.linspace(0.0, 4.2, 200)
    joints = {name: 0.4 * np.sin(2.0 * time_s + k) for k, name in enumerate(pendulum.joint_names)}
    folder = tmp_path_factory.mktemp("motion")
    oarlock.simulate(pendulum, oarlock.simulation.Motion.from_joints(time_s, joints))[0].save(folder)
    return folder


@pytest.fixture(scope="session", autouse=True)
def own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test writes into the state folder of a user."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(params=season_places.KINDS)
def season_address(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Address of an empty place for a season: on disk, in memory, on a server that speaks S3."""
    return season_places.new_address(request.param, tmp_path, monkeypatch)
