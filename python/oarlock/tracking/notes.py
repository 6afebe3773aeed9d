"""`Note`: a sentence on a track, with a code that programs can react to."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

CODES: Mapping[str, str] = MappingProxyType(
    {
        "nominal_mounts": "mounts: nominal for",
        "heading_undetermined": "the heading of its mount is not determined",
        "encoder_as_read": "the value is the reading of the encoder",
        "not_observed": "not observed",
        "joints_contradict_unit": "its joints contradict the unit's own readings",
        "sensor_suspect": "no known fault explains it|look exchanged|looks stuck|deg about its|in other axes \\(|"
        "cannot be determined yet|times as fast as gravity in the accelerometer",
        "no_stream": "^no stream for",
        "readings_not_used": "readings are not used because the model's|never used \\(|not used by strapdown links",
        "beyond_limits": "beyond its soft limits",
        "beyond_range": "beyond its range \\(",
        "rejected": "were rejected",
        "fast_vibration": "vibrated faster than limbs move",
        "time_order": "time stamps did not increase",
        "magnetic_disturbance": "magnetic field disturbed in|a magnet or iron near|"
        "turns the headings of its segments back",
        "end_of_range": "at the end of the sensor's range in",
        "stuck": "readings stuck|throughout while others move",
        "no_magnetometer": "no magnetometer readings from|no unit has a magnetometer",
        "filter_reset": "the filter was reset|sensors were off, or a|for single readings",
        "model_misfit": "The mounts or the model do not fit",
        "corrected": "were subtracted|were scaled|was corrected|were corrected|were applied",
        "implausible": "\\|accel\\| (in|at)|is zero throughout|\\|gyro\\| reaches|the median of \\|mag\\|",
        "missing_readings": "has no reading|its first reading is missing until|its readings end|"
        "fewer than half of the rows",
        "gaps": "gaps in time, longest|samples of its own rate",
        "late_start": "by the first 20 s of movement",
        "live_differs": "live estimates differ from those",
        "near_pole": "within 15 deg of the pole",
        "many_rows": "of [\\d,]+ rows",
    }
)
"""A code and what stands in its sentences, a regular expression; the first that fits counts."""


class Note(str):
    """A sentence on a track. It is a text: `print(note)`, `"stuck" in note`.

    `code` is one of `CODES`, or "" for what only people read.
    """

    __slots__ = ()

    @property
    def code(self) -> str:
        """What kind of note it is, such as `not_observed`."""
        return next((code for code, pattern in CODES.items() if re.search(pattern, self)), "")

    @property
    def subject(self) -> str:
        """Joint, sensor or stream that it is about, several with commas; "" if it names none."""
        named = re.match(r"(?:mounts: nominal for|no stream for:?) ([\w., ]+);|([\w., ]+): ", self)
        return "" if named is None else (named[1] or named[2])

    @property
    def value(self) -> float | None:
        """The first number of the sentence, in the unit behind it; None without one."""
        number = re.search(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])", self)
        return None if number is None else float(number[0])

    @property
    def text(self) -> str:
        """The sentence."""
        return str(self)


_CONTRADICT = ": its joints contradict the unit's own readings"
"""What follows the name of the unit in the engine's note."""


def contradicted_units(notes: Sequence[str]) -> list[str]:
    """Names of the units that the engine reports."""
    return [note.partition(_CONTRADICT)[0] for note in notes if _CONTRADICT in note]


def undetermined_units(notes: Sequence[Note]) -> list[str]:
    """Names of the units whose mount has no determined heading."""
    return [note.subject for note in notes if note.code == "heading_undetermined"]
