"""Settings of all tests: hypothesis measures no time; the last line counts functions beside their parameters."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import settings

# A deadline would fail on a busy machine.
settings.register_profile("oarlock", deadline=None)
settings.load_profile("oarlock")

RUN = pytest.StashKey[frozenset[str]]()


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
