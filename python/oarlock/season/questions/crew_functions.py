"""Functions of a season's SQL about crews: which seat is nearest to the stern, and which strokes belong together."""

from __future__ import annotations

from typing import Any

import numpy as np

from oarlock.rowing.crew.matching import delays
from oarlock.rowing.crew.seats import seat_place
from oarlock.storage.errors import DataError


def add_crew_functions(connection: Any) -> None:
    """Registers `seat_place(seat)` and `delays(leader, own, after_s)` with DuckDB."""
    kept = {"null_handling": "special"}
    connection.create_function("seat_place", _place, ["VARCHAR"], "DOUBLE", **kept)
    connection.create_function("delays", _delays, ["DOUBLE[]", "DOUBLE[]", "DOUBLE"], "DOUBLE[]")


def _place(seat: str | None) -> float | None:
    """Counted from the bow; None for what names no seat."""
    try:
        return seat_place(seat) if seat else None
    except DataError:
        return None


def _delays(leader_s: list[float], own_s: list[float], after_s: float) -> list[float | None]:
    """How much later than the leader's each catch is, s; None without a partner.

    Args:
        leader_s: increasing times from the start of its recording.
        own_s: as `leader_s`, of the other recording.
        after_s: how much later than the leader's the own recording starts.
    """
    late = delays(np.asarray(leader_s), np.asarray(own_s) + after_s)
    return [None if np.isnan(one) else float(one) for one in late]
