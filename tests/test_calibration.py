import copy

import numpy as np
import pytest

from oarlock.recording.calibration import Calibration, load_calibration
from oarlock.storage.errors import DataError

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def refused(**values):
    with pytest.raises(DataError) as caught:
        Calibration(**values)
    return str(caught.value)


def test_file_gives_back_every_bit(tmp_path):
    angle = 0.1
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    calibration = Calibration(
        {"l_b": 1 / 3},
        {"back": (rotation, [0.1, 0.2, 1 / 3])},
        {"how": "still pose"},
        {"back": [1.5, -2 / 3, 0]},
    )
    calibration.save(tmp_path / "wearing.toml")
    again = load_calibration(tmp_path / "wearing.toml")
    assert again.parameters == {"l_b": 1 / 3}
    assert again.noted == {"how": "still pose"}
    assert again.mag_offsets_ut["back"].tobytes() == calibration.mag_offsets_ut["back"].tobytes()
    for one, other in zip(again.mounts["back"], calibration.mounts["back"], strict=True):
        assert one.tobytes() == other.tobytes()


def test_it_does_not_change():
    calibration = copy.deepcopy(
        Calibration({"l_b": 0.5}, {"back": (TURN, np.zeros(3))}, mag_offsets_ut={"back": np.ones(3)})
    )
    with pytest.raises(TypeError):
        calibration.parameters["l_b"] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        calibration.mounts["back"][0][0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        calibration.mag_offsets_ut["back"][0] = 2.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"parameters": {"l_b": float("nan")}}, ['parameter "l_b"', "nan"]),
        ({"parameters": {"l_b": "0.3"}}, ['parameter "l_b"', "not real and numeric"]),
        ({"mag_offsets_ut": {"back": [1.0, 2.0]}}, ['mag_offsets_ut of "back"', "(2,)", "(3,)"]),
        (
            {"mag_offsets_ut": {"back": [1.0, 2.0, float("nan")]}},
            ['mag_offsets_ut of "back"', "finite", "uT"],
        ),
        ({"mounts": {"back": TURN}}, ['mount of "back"', "offset_m"]),
        ({"mounts": {"back": (2 * TURN, np.zeros(3))}}, ['mount of "back"', "orthonormal", "3"]),
        ({"mounts": {"back": (-TURN, np.zeros(3))}}, ['mount of "back"', "mirror"]),
        ({"mounts": {"back": (TURN, np.zeros(2))}}, ["offset_m", "(2,)", "(3,)"]),
        ({"mounts": {"back": (TURN, [0.0, np.inf, 0.0])}}, ["offset_m", "finite"]),
        ({"mounts": {"back": (np.full((3, 3), np.nan), np.zeros(3))}}, ["orthonormal"]),
    ],
)
def test_bad_values(values, words):
    text = refused(**values)
    for word in words:
        assert word in text


def test_unknown_key_in_a_file(tmp_path):
    file = tmp_path / "wearing.toml"
    file.write_text("format = 1\n[mounts.back]\nrotaton = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n")
    with pytest.raises(DataError, match=r'wearing.toml:3, key "rotaton" of \[mounts.back\].*"rotation"'):
        load_calibration(file)
