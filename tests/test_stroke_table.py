"""The table of strokes, what its numbers mean, and targets."""

import csv

import numpy as np
import pytest

from oarlock import DataError
from oarlock.rowing import FEATURES, TARGET_CLASSES, StrokeTable, load_targets


def two_strokes() -> StrokeTable:
    return StrokeTable(
        {"catch_time_s": [1.0, 3.5], "arc_rad": [np.nan, 1.9]},
        {"arc_rad": [np.nan, 0.01]},
        {"arc_rad": ("the oar was not read", "")},
        {"force_n": (np.arange(3.0), np.arange(5.0))},
        source="by hand",
    )


def test_a_row_holds_values_and_their_standard_deviations():
    first, second = two_strokes().to_rows()
    assert second == {"catch_time_s": 3.5, "arc_rad": 1.9, "arc_rad_std": 0.01}
    assert np.isnan(first["arc_rad"])


def test_csv_explains_its_columns_and_leaves_unknowns_empty(tmp_path):
    two_strokes().to_csv(tmp_path / "strokes.csv")
    lines = (tmp_path / "strokes.csv").read_text(encoding="utf-8").splitlines()
    notes, rows = [x for x in lines if x.startswith("#")], [x for x in lines if not x.startswith("#")]
    assert any(FEATURES["arc_rad"].definition in note for note in notes)
    assert any("the oar was not read" in note for note in notes)
    read = list(csv.DictReader(rows))
    assert read[0]["arc_rad"] == "" and float(read[1]["arc_rad"]) == 1.9


def test_plain_csv_has_a_header_and_a_line_a_stroke(tmp_path):
    two_strokes().to_csv(tmp_path / "strokes.csv", explained=False)
    assert len((tmp_path / "strokes.csv").read_text(encoding="utf-8").splitlines()) == 3


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (({"a": [1.0], "b": [1.0, 2.0]},), "'b': has 2 rows, but 'a' has 1"),
        (({"a": [[1.0]]},), "one number a stroke"),
        (({"a": [1.0]}, {"b": [1.0]}), "no such column"),
        (({"a": [1.0]}, {}, {"a": ("", "")}), "2 rows"),
        (({},), "at least one column"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, says):
    with pytest.raises(DataError, match=says):
        StrokeTable(*arguments)


def test_a_missing_column_names_those_there_are():
    with pytest.raises(KeyError, match="catch_time_s"):
        two_strokes()["nonsense"]


def test_a_column_without_deviations_has_none():
    assert np.isnan(two_strokes().std("catch_time_s")).all()


def test_every_feature_says_what_it_is_in_units_that_can_be_shown():
    endings = {
        "rad": "_rad",
        "s": "_s",
        "m": "_m",
        "m/s": "_m_s",
        "m/s2": "_m_s2",
        "m2": "_m2",
        "1/min": "_per_min",
    }
    for name, feature in FEATURES.items():
        assert feature.label and feature.definition.endswith(".") and feature.source
        assert feature.shown_scale > 0.0
        assert name.endswith(endings.get(feature.unit, "")), f"{name} is in {feature.unit}"
        assert feature.in_words.count("..") == 0


def test_sides_are_said_both_ways():
    assert "port" in FEATURES["r_arc_rad"].label and "starboard" in FEATURES["l_arc_rad"].label


@pytest.mark.parametrize("name", TARGET_CLASSES)
def test_shipped_targets_have_sources_and_stand_in_the_columns_units(name):
    targets = load_targets(name)
    assert targets
    for column, target in targets.items():
        assert column in FEATURES and target.source and target.low <= target.high


def test_targets_of_one_class_are_what_the_source_says():
    targets = load_targets("sculling_men")
    assert np.degrees(targets["catch_angle_rad"].low) == pytest.approx(-66.0)
    assert targets["catch_factor_s"].low == pytest.approx(-0.015)
    assert targets["rhythm"].high == pytest.approx(0.55)
    assert 0.65 in targets["drive_time_s"] and 0.75 not in targets["drive_time_s"]


def test_targets_of_ones_own(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[mine]\nfinish_lean_deg = { value = [20, 25], source = "me" }\n', encoding="utf-8")
    assert np.degrees(load_targets(file)["finish_lean_rad"].high) == pytest.approx(25.0)
    assert load_targets(f"{file}:mine").keys() == {"finish_lean_rad"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[a]\nnonsense_deg = { value = 1 }", "nonsense_deg"),
        ("[a]\narc_deg = { value = [3, 2] }", "arc_deg"),
        ("[a]\narc_deg = 100", "value = 44"),
        ("[a]\n[b]\n", "name one"),
        ("[a", "mine.toml"),
    ],
)
def test_wrong_targets_say_where(tmp_path, text, says):
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=says):
        load_targets(tmp_path / "mine.toml")


def test_unknown_targets_name_the_classes():
    with pytest.raises(DataError, match="sculling_women"):
        load_targets("eights")
