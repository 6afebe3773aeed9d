"""Findings: one planted change is named first, nothing in unchanged pieces; words, sources, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from drawn_strokes import (
    EARLY_BACK,
    LATE_LEFT,
    LATE_RIGHT,
    LESS_LEAN_SHORT,
    LESS_LEAN_SLIDE,
    SHORT,
    TIRED,
    drawn,
)
from oarlock.rowing.analysis.targets import load_targets
from oarlock.rowing.findings.at_like_rate import change
from oarlock.rowing.findings.candidate import MetricComparison, beyond_chance, chance
from oarlock.rowing.findings.causes import by_cause
from oarlock.rowing.findings.find import comparisons, findings_of, named
from oarlock.rowing.findings.watched import WATCHED

SEEDS = range(41, 44)
LENGTH = {"arc_rad", "catch_angle_rad", "finish_angle_rad", "lean_swing_rad", "catch_lean_rad"}
STEADY = (26.0, 26.0)


@pytest.mark.parametrize(
    ("planted", "kind", "names"),
    [
        (LATE_RIGHT, "sides", {"catch_time_difference_s"}),
        (LATE_LEFT, "sides", {"catch_time_difference_s"}),
        (LESS_LEAN_SHORT, "against last", {"catch_lean_rad"}),
        (LESS_LEAN_SLIDE, "against last", {"catch_lean_rad"}),
        (EARLY_BACK, "against last", {"trunk_peak_position"}),
        (SHORT, "against last", {"arc_rad", "catch_angle_rad"}),
        (TIRED, "drift", LENGTH),
    ],
)
@pytest.mark.parametrize("rates", [STEADY, (22.0, 30.0)])
def test_one_planted_change_is_named_first(planted, kind, names, rates):
    for seed in SEEDS:
        found = findings_of(drawn(rates, seed, **planted), {"against last": drawn(rates, seed + 100)})
        assert found and found[0].kind == kind and found[0].name in names, (seed, found)


@pytest.mark.parametrize("rates", [STEADY, (20.0, 34.0), (34.0, 20.0), (20.0, 24.0, 36.0, 20.0)])
def test_nothing_is_named_where_nothing_changed_whatever_the_rate_does(rates):
    for seed in SEEDS:
        others = {
            "against last": drawn((25.0, 27.0), seed + 100),
            "against best": drawn((28.0, 28.0), seed + 200),
        }
        assert findings_of(drawn(rates, seed), others) == []


def test_sizes_are_those_planted_and_sentences_say_which_hand():
    late = findings_of(drawn(STEADY, 3, **LATE_RIGHT), {})[0]
    # The left hand of the simulated sculler is 0.3 % of the period, 7 ms, later by habit; the turn is 60 ms later.
    assert late.size == pytest.approx(53.0, abs=6.0)
    assert late.sentence.startswith("The right hand catches 5") and late.sentence.endswith(
        "later than the left."
    )
    assert findings_of(drawn(STEADY, 3, **LATE_LEFT), {})[0].sentence.startswith("The left hand catches ")
    lean = findings_of(drawn(STEADY, 3, **LESS_LEAN_SHORT), {"against last": drawn(STEADY, 4)})[0]
    assert lean.size == pytest.approx(4.0, abs=1.96 * lean.size_1sd)
    assert "forward lean at the catch is " in lean.sentence and "° less than last time" in lean.sentence
    assert "With it" in lean.sentence and lean.unit == "deg"


def test_last_and_best_together_are_one_finding_and_pieces_at_other_rates_are_not_compared():
    rowed = drawn(STEADY, 5, **SHORT)
    both = findings_of(rowed, {"against last": drawn(STEADY, 6), "against best": drawn(STEADY, 7)})
    assert [one.kind for one in both] == ["against last"]
    assert findings_of(rowed, {"against last": drawn((36.0, 36.0), 6)}) == []
    assert findings_of(rowed, {"against last": replace(drawn(STEADY, 6), kind="ergometer")}) == []


def test_an_error_that_all_strokes_share_is_not_a_finding():
    rowed = drawn(STEADY, 8, **LATE_RIGHT)
    wide = {**rowed.stds, "catch_time_difference_s": np.full(len(rowed.numbers), 0.03)}
    assert findings_of(replace(rowed, stds=wide), {}) == []


def test_an_odd_stroke_is_named_once_with_its_number():
    rowed = drawn(STEADY, 9)
    arc, finish = (rowed.columns[name].copy() for name in ("arc_rad", "finish_angle_rad"))
    for values in (arc, finish):
        values[11] -= np.radians(14.0)
    found = findings_of(
        replace(rowed, columns={**rowed.columns, "arc_rad": arc, "finish_angle_rad": finish}), {}
    )
    assert [one.kind for one in found] == ["odd stroke"]
    assert found[0].sentence.startswith("Stroke 12 is unusual: ")


def test_chosen_targets_are_usual_values_and_those_of_race_rate_wait_for_it():
    rowed = replace(drawn(STEADY, 10), targets=load_targets("sculling_men"))
    found = {one.name: one for one in findings_of(rowed, {})}
    # Rowed from -61 to 42 deg, against -66 and 44: the finish is at the smallest size that is named.
    assert set(found) - {"finish_angle_rad"} == {"catch_angle_rad"}
    assert (
        found["catch_angle_rad"].kind == "against usual" and "RtcNoord" in found["catch_angle_rad"].sentence
    )


def test_few_strokes_missing_numbers_and_sweep():
    few = drawn(STEADY, 11, duration_s=12.0, **TIRED)
    assert findings_of(few, {"against last": few}) == []
    unknown = drawn(STEADY, 12, **LATE_RIGHT)
    columns = {name: np.full(len(unknown.numbers), np.nan) for name in unknown.columns}
    assert findings_of(replace(unknown, columns=columns), {"against last": unknown}) == []
    assert findings_of(replace(unknown, kind="sweep"), {}) == []


def test_every_text_has_a_source_and_every_column_exists():
    for one in WATCHED.values():
        for told in (
            one.why,
            *one.tries.values(),
            *(one.usual_of(kind) for kind in ("sculling", "sweep", "ergometer")),
        ):
            assert bool(told.text) == bool(told.source), (one.name, told)
        related = {*one.causes, *one.goes_with, *one.beside} - set(WATCHED)
        # The peak of the legs is no finding by itself: two humps of nearly one height make it jump.
        assert related <= {"legs_peak_position", "arc_symmetry"}, one.name
        assert one.least > 0.0 and (one.sides or (one.subject and one.grew and one.fell))


@pytest.mark.parametrize(("kind", "name"), [("sides", "catch_time_difference_s"), ("drift", "arc_rad")])
def test_a_difference_is_named_from_the_size_that_a_page_states(kind, name):
    # Everything else that was compared is certain by itself to be chance, so Holm's first step decides.
    rowed = drawn(STEADY, 13)
    every = [replace(one, size=0.0, chance=1.0) for one in comparisons(rowed, {})]
    one = next(one for one in every if one.kind == kind and one.watched.name == name)
    others = [other for other in every if other is not one]
    limit = one.named_from(len(every))
    assert limit >= one.watched.least
    for factor, expected in ((0.99, []), (1.01, [name])):
        size = factor * limit
        sized = replace(one, size=size, now=size, chance=chance(size, one.sd, one.freedom))
        assert [found.name for found in named(rowed, [*others, sized])] == expected


def test_a_number_within_its_usual_range_is_not_beyond_it():
    arc = WATCHED["arc_rad"]
    assert [arc.beyond_usual("sculling", value) for value in (99.0, 102.0, 108.0, 112.0)] == [
        -3.0,
        0.0,
        0.0,
        2.0,
    ]
    assert arc.beyond_usual("ergometer", 20.0) == 0.0


def test_a_change_that_the_rate_explains_as_well_is_uncertain():
    random = np.random.default_rng(1)
    later = np.arange(30) >= 20
    steps = np.repeat([20.0, 24.0, 28.0], 10)
    values = 100.0 - 0.4 * steps + random.normal(0.0, 0.5, 30)
    confounded = change(values, steps, later, 0.4)
    # 6 strokes a minute more than before, at 0.4 a stroke; the bend takes more than half of the doubt away.
    assert confounded.rate_sd > 0.9
    steady = change(values + 0.4 * steps, random.normal(24.0, 0.3, 30), later, 0.4)
    assert steady.rate_sd < 0.2 and abs(steady.size) < 3.0 * steady.scatter_sd


def candidate(name, size, kind="against last", chance=0.0):
    return MetricComparison(WATCHED[name], kind, size, 0.5, chance, size)


def test_a_small_lean_does_not_take_the_blame_for_a_much_shorter_stroke():
    causes = by_cause(
        [candidate("catch_lean_rad", 2.2), candidate("catch_angle_rad", 9.0), candidate("arc_rad", -9.0)]
    )
    assert [cause.lead.watched.name for cause in causes] in (["arc_rad"], ["catch_angle_rad"])


def test_of_many_comparisons_only_the_sure_ones_stay():
    unsure = [candidate("arc_rad", 9.0, chance=0.01) for _ in range(20)]
    assert beyond_chance(unsure, 0.02) == []
    sure = candidate("catch_lean_rad", 4.0, chance=1e-5)
    assert beyond_chance([*unsure, sure], 0.02) == [sure]
    assert beyond_chance([candidate("catch_lean_rad", 1.9, chance=1e-9)], 0.02) == []
