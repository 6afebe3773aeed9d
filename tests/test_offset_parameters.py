"""Which parameters of a model file are the place of a unit, and nothing else."""

from pathlib import Path

import numpy as np
import pytest

import oarlock
from oarlock.calibration.static.offset_parameters import offset_parameters
from oarlock.calibration.static.worn_model import Worn

PLACE = 'mount.offset = ["r2_x", "r2_y", "r2_z"]'
FOUND = {"body1": np.array([0.1, 0.02, 0.0]), "body2": np.array([0.0, 0.03, -0.1])}
HAND = """
[[frame]]
name = "hand"
parent = "body2"
transform = { translation = ["r2_x", 0, 0.1] }
"""


def told(tmp_path: Path, *changes: tuple[str, str], known: oarlock.Calibration | None = None, taken=()):
    text = oarlock.load_model("dfjimu").text
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    file = tmp_path / "pair.toml"
    file.write_text(text, encoding="utf-8")
    return offset_parameters(Worn.of(oarlock.load_model(file), known), FOUND, taken)


def test_each_axis_follows_a_parameter_of_its_own(tmp_path):
    found = told(tmp_path)
    assert found["body1"] == pytest.approx({"r1_x": 0.1, "r1_y": 0.02, "r1_z": 0.0})
    assert found["body2"] == pytest.approx({"r2_x": 0.0, "r2_y": 0.03, "r2_z": -0.1})


def test_what_the_place_adds_to_a_parameter_stays(tmp_path):
    found = told(tmp_path, (PLACE, 'mount.offset = ["r2_x + 0.05", "r2_y", "r2_z"]'))
    assert found["body2"]["r2_x"] == pytest.approx(-0.05)


@pytest.mark.parametrize(
    "offset",
    [
        '["-r2_x", "r2_y", "r2_z"]',
        '["2 * r2_x", "r2_y", "r2_z"]',
        '["r2_x", "r2_x + r2_y", "r2_z"]',
        '["r2_x + r2_y", 0, "r2_z"]',
        '["r1_x", "r2_y", "r2_z"]',
        '[0.1, "r2_y", "r2_z"]',
    ],
    ids=["negative", "scaled", "of two axes", "two on an axis", "of two units", "a number"],
)
def test_other_places_stay_with_the_mount(tmp_path, offset):
    assert "body2" not in told(tmp_path, (PLACE, f"mount.offset = {offset}"))


def test_a_parameter_that_moves_more_than_a_unit_is_left_alone(tmp_path):
    found = told(tmp_path, ("[[sensor]]", HAND + "\n[[sensor]]"))
    assert set(found) == {"body1"}


def test_what_is_told_otherwise_or_has_a_mount_is_left_alone(tmp_path):
    worn = oarlock.Calibration(mounts={"body2": (np.eye(3), np.zeros(3))})
    assert set(told(tmp_path, known=worn)) == {"body1"}
    assert set(told(tmp_path, taken=["r1_y"])) == {"body2"}
