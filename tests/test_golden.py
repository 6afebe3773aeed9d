"""Outputs are those that were committed: tracks, imports, calibrations, scores, exports, pages, sessions and errors."""

import numpy as np
import pytest
from golden.cases import GROUPS, collect, data_folder
from golden.compare import committed_form, differences, load_committed, renamed, unlike_committed

FIRST = {
    "track/arm/q": np.array([[0.1, np.nan], [0.2, 0.3]]),
    "track/arm/q_std": np.array([[0.01, np.nan], [0.01, 0.02]]),
    "mistake/model/no_noise": "ModelError body.toml:36",
}


def parameters() -> list[object]:
    marks = {
        name: [pytest.mark.data] * group.needs_data + [pytest.mark.long] * group.is_long
        for name, group in GROUPS.items()
    }
    return [pytest.param(name, marks=marks[name]) for name in GROUPS]


@pytest.mark.parametrize("name", parameters())
def test_outputs_are_those_that_were_committed(name):
    if GROUPS[name].needs_data and data_folder() is None:
        pytest.skip(f"NOT RUN: {name}: set OARLOCK_DATA to a folder with data/")
    unlike = unlike_committed(collect(name), load_committed([name]))
    assert not unlike, "\n".join(map(str, unlike))


def test_a_track_may_differ_by_a_billionth_of_its_standard_deviation():
    committed = committed_form(FIRST)
    for parts, keys in ((0.5e-9, []), (2e-9, ["track/arm/q"])):
        later = FIRST | {
            "track/arm/q": FIRST["track/arm/q"] + parts * np.nan_to_num(FIRST["track/arm/q_std"])
        }
        assert [difference.key for difference in unlike_committed(later, committed)] == keys


def test_missing_new_and_other_outputs_are_differences():
    committed = committed_form(FIRST)
    other = {
        "track/arm/q": FIRST["track/arm/q"],
        "track/arm/q_std": FIRST["track/arm/q_std"][:1],
        "mistake/model/no_name": "ModelError",
    }
    texts = {difference.key: difference.text for difference in unlike_committed(other, committed)}
    assert texts == {
        "mistake/model/no_name": "is not committed",
        "mistake/model/no_noise": "is no longer computed",
        "track/arm/q_std": "shape [2, 2] -> [1, 2]",
    }


def test_a_comparison_to_the_bit_says_how_much_in_standard_deviations():
    assert differences(FIRST, dict(FIRST)) == []
    q = FIRST["track/arm/q"] + np.array([[0.0, 0.0], [0.002, 0.0]])
    (difference,) = differences(FIRST, FIRST | {"track/arm/q": q})
    assert str(difference) == "track/arm/q: largest difference 0.002, in 1 of 4, 0.2 standard deviations"


def test_outputs_are_compared_under_their_new_keys(tmp_path, monkeypatch):
    table = tmp_path / "renames.toml"
    table.write_text(
        '[[rename]]\nold = "track/arm"\nnew = "track/reach"\nreason = "shorter"\n', encoding="utf-8"
    )
    monkeypatch.setattr("golden.compare.RENAMES", table)
    assert list(renamed(FIRST)) == ["track/reach/q", "track/reach/q_std", "mistake/model/no_noise"]


def test_samples_of_shared_recordings_are_not_committed():
    value = np.arange(300.0).reshape(100, 3) + 0.123
    forms = committed_form({"shared_track/dfjimu/q": value, "shared_import/a.mat/body1/time_s": value[:2, 0]})
    assert set(forms["shared_track/dfjimu/q"]) == {"shape", "digest"}
    assert len(forms["shared_track/dfjimu/q"]["digest"]) == 4
    assert set(forms["shared_import/a.mat/body1/time_s"]) == {"shape", "hash"}
