"""Notes of a track as objects: every note of the inventory has a code; subject and value of some."""

import pickle
import tomllib
from pathlib import Path

import pytest

from oarlock.tracking.notes import CODES, Note

INVENTORY = tomllib.loads((Path(__file__).parents[1] / "checks/inventory.toml").read_text("utf-8"))["notes"]
OF_OTHERS = (
    "closures left out of",
    "no stream measured it",
    "Its value there follows",
    "Strokes were found from",
)
OF_OTHERS += (
    "oar never moved",
    "was measured; numbers",
    "without a sensor in this model",
    "no working sensor",
)
OF_OTHERS += ("its sensors do not determine", "its encoder has readings")
"""Notes of exports and strokes, and reasons inside of "not observed"."""


@pytest.mark.parametrize("text", [t for t, there in INVENTORY.items() if there in ("same", "new")])
def test_a_note_has_a_code(text: str) -> None:
    sentence = f"imu: {text}".replace("{rows}", "40")
    assert Note(sentence).code or Note(text).code or text.startswith(OF_OTHERS)


@pytest.mark.parametrize(
    ("text", "code", "subject", "value"),
    [
        ("mounts: nominal for back, hand; a sensor mounted 5 deg off", "nominal_mounts", "back, hand", 5.0),
        ("elbow: not observed (no stream)", "not_observed", "elbow", None),
        ("no stream for: wrist; check the recording's stream names", "no_stream", "wrist", None),
        ("back: 12 of 400 readings (3.0 %) were rejected; check its mount", "rejected", "back", 12.0),
        ("back: 12 of 400 readings (3.0 %) were rejected, 4 samples in", "rejected", "back", 12.0),
        ("hips: the heading of its mount is not determined", "heading_undetermined", "hips", None),
        ("gyroscope biases of back were subtracted", "corrected", "", None),
        ("a sentence of a person", "", "", None),
    ],
)
def test_code_subject_and_value(text: str, code: str, subject: str, value: float | None) -> None:
    note = pickle.loads(pickle.dumps(Note(text)))
    assert (note, note.code, note.subject, note.value) == (text, code, subject, value)


def test_codes_are_distinct_names() -> None:
    assert all(code.isidentifier() and pattern for code, pattern in CODES.items())
    assert "not_observed" in CODES
