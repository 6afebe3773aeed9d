"""Acceptance of findings: rowed, measured, tracked, compared with last time and best; one change or none planted."""

from functools import cache

import pytest

import oarlock
from drawn_strokes import EARLY_BACK, LATE_LEFT, LATE_RIGHT, LESS_LEAN_SHORT, LESS_LEAN_SLIDE, SHORT, TIRED
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.findings.find import findings
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.simulation.experiment import simulate_sculling

pytestmark = pytest.mark.long

DURATION_S = 50.0
UNCHANGED = 20
SEEDS = 10
LEAST_RIGHT = 9
FIRST_SEED = {"unchanged": 5000, "late": 5100, "lean": 5200, "early": 5300, "short": 5400, "tired": 5500}
"""Apart from all seeds with which findings were made."""
PLANTED = {
    "late": ((LATE_RIGHT, LATE_LEFT), "sides", {"catch_time_difference_s"}),
    "lean": ((LESS_LEAN_SHORT, LESS_LEAN_SLIDE), "against last", {"catch_lean_rad"}),
    "early": ((EARLY_BACK,), "against last", {"trunk_peak_position", "style_factor"}),
    "short": ((SHORT,), "against last", {"arc_rad", "catch_angle_rad"}),
    "tired": ((TIRED,), "drift", {"arc_rad", "catch_angle_rad", "lean_swing_rad", "catch_lean_rad"}),
}
RATES = ((22.0, 22.0), (24.0, 24.0), (26.0, 26.0), (22.0, 32.0), (30.0, 30.0))


def rowed(seed: int, number: int, planted: dict[str, object]) -> ReportPiece:
    model = oarlock.load_model("sculler")
    rates = RATES[number % len(RATES)]
    _, recording = simulate_sculling(model, "B-B", DURATION_S, rates, seed, **planted)
    track = oarlock.track(model, recording)
    return ReportPiece("", track, technique(track))


@cache
def unchanged(number: int) -> ReportPiece:
    return rowed(FIRST_SEED["unchanged"] + number, number, {})


def others(number: int) -> tuple[ReportPiece, ReportPiece]:
    """Last time and own best: other pieces in which nothing is planted, at the same rates."""
    return tuple(unchanged((number + ahead * len(RATES)) % UNCHANGED) for ahead in (1, 2))


@pytest.mark.parametrize("change", PLANTED)
def test_a_planted_change_is_named_first(change: str) -> None:
    variants, kind, names = PLANTED[change]
    firsts = []
    for number in range(SEEDS):
        piece = rowed(FIRST_SEED[change] + number, number, variants[number % len(variants)])
        found = findings(piece, *others(number))
        firsts.append((found[0].kind, found[0].name) if found else None)
    right = sum(first is not None and first[0] == kind and first[1] in names for first in firsts)
    print(f"{change}: {right} of {SEEDS}; {firsts}")
    assert right >= LEAST_RIGHT, firsts


def test_nothing_is_named_in_unchanged_pieces() -> None:
    named = {number: findings(unchanged(number), *others(number)) for number in range(UNCHANGED)}
    told = {number: [one.sentence for one in found] for number, found in named.items() if found}
    print(f"unchanged: nothing named in {UNCHANGED - len(told)} of {UNCHANGED}; {told}")
    assert len(told) <= 1, told
