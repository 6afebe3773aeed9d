"""What a column's name says: unit, quantity, axis and unit of measurement. For tables without a mapping file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

from oarlock.formats.arbitrary_units import ARBITRARY

Quantity: TypeAlias = Literal["accel", "gyro", "mag", "quat"]

_WORDS: tuple[tuple[Quantity, str], ...] = (
    ("accel", "accelerometer|acceleration|accelero|accel|acce|acc"),
    ("gyro", "gyroscope|gyrometer|gyros|gyro|gyr|angular[ _-]?velocity|angular[ _-]?rate|angvel|omega"),
    ("mag", "magnetometer|magnetic[ _-]?field|magnetic|magn|mag"),
    ("quat", "quaternion|quat|orientation"),
)
_AXES: Mapping[Quantity, str] = MappingProxyType(
    {"accel": "xyz", "gyro": "xyz", "mag": "xyz", "quat": "wxyz0123"}
)
_SHORT: Mapping[str, Quantity] = MappingProxyType({"a": "accel", "g": "gyro", "w": "gyro", "m": "mag"})
_SHORT_NAME = re.compile(r"(?<![A-Za-z0-9])([agmwAGMW])_?([xyzXYZ])(?![A-Za-z])")
_SHORT_QUATERNION = re.compile(r"(?<![A-Za-z0-9])[qQ]_?([wxyzWXYZ0-4])(?![A-Za-z0-9])")
_LONGEST_NAME = 200
_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]")
_NOT_MEASURED = frozenset(
    [
        "lin",
        "linear",
        "free",
        "user",
        "gravity",
        "earth",
        "world",
        "global",
        "bias",
        "offset",
        "std",
        "norm",
        "magnitude",
        "joint",
        "angle",
        "high",
        "highg",
        "euler",
        "time",
        "series",
    ]
)
"""Words of columns that no inertial unit measures so: computed ones, and a second accelerometer of a wide range."""
_FILLERS = frozenset(["noraxon", "myomotion", "ultium", "segments", "cal", "raw", "data", "im", "value", "q"])
_QUANTITY_WORDS = frozenset(word for _, words in _WORDS for word in words.split("|"))
_SPELLINGS: Mapping[Quantity, Mapping[str, str]] = MappingProxyType(
    {
        "accel": {
            **dict.fromkeys(("g", "gs", "gn", "g0"), "g"),
            **dict.fromkeys(("mg",), "mg"),
            **dict.fromkeys(
                ("m/s2", "m/s/s", "ms-2", "m/sec2", "ms2", "mps2", "m_s2", "m_s_2", "m/s**2"), "m/s2"
            ),
            **dict.fromkeys(("mm/s2",), "mm/s2"),
        },
        "gyro": {
            **dict.fromkeys(
                ("deg/s", "dps", "°/s", "º/s", "deg/sec", "degrees/s", "deg_s", "degs", "degpers"), "deg/s"
            ),
            **dict.fromkeys(("rad/s", "rad/sec", "rads", "rad_s", "radps", "rads-1", "rps"), "rad/s"),
        },
        "mag": {
            **dict.fromkeys(("ut", "microtesla", "utesla"), "uT"),
            **dict.fromkeys(("gauss", "ga", "g"), "gauss"),
            **dict.fromkeys(("mgauss", "mga", "mg"), "mG"),
            **dict.fromkeys(("nt",), "nT"),
            **dict.fromkeys(("t", "tesla"), "T"),
            **dict.fromkeys(
                ("a.u.", "a.u", "au", "arb", "arb.", "arbitrary", "normalised", "normalized"), ARBITRARY
            ),
        },
        "quat": {},
    }
)


@dataclass(frozen=True)
class InertialColumn:
    """A column that an inertial unit measures.

    Args:
        unit: name of the inertial unit, in small letters with `_`; empty if the column names none.
        quantity: what it measures.
        axis: "x", "y", "z"; of a quaternion "w" to "z" or "0" to "4".
        measured_in: the unit of measurement; None if the name says none.
        is_raw: the name says that the sensor itself measures it.
    """

    unit: str
    quantity: Quantity
    axis: str
    measured_in: str | None
    is_raw: bool


def channel_of(name: str, unit_below: str = "") -> InertialColumn | None:
    """What a column contains; None if no inertial unit measures it.

    Args:
        name: as the header has it.
        unit_below: text of the column in a line of units.
    """
    if len(name) > _LONGEST_NAME:
        return None
    bracketed = _BRACKETS.findall(name)
    bare = _BRACKETS.sub(lambda found: " " if _is_unit(found[1]) else found[0], name).strip()
    found = _by_word(bare) or _by_letter(bare)
    if found is None:
        return None
    quantity, axis, before, between, after = found
    between, after = (text.strip(" _-.:/'") for text in (between, after))
    texts = [*bracketed, between, after, unit_below]
    measured_in = next((unit for text in texts if (unit := measured_unit(text, quantity))), None)
    parts = [before, *(text for text in (between, after) if not measured_unit(text, quantity))]
    words = _words(" ".join(parts))
    plain = {part for word in words for part in _split(word)}
    if plain & _NOT_MEASURED:
        return None
    return InertialColumn(_name(words), quantity, axis, measured_in, "sensor" in plain)


def unit_name(text: str) -> str:
    """A unit's name in small letters with `_`, without a number in brackets: "Femur (75657)" gives "femur"."""
    return _name(_words(_BRACKETS.sub(" ", text)))


def measured_unit(text: str, quantity: Quantity) -> str | None:
    """A unit of measurement as Oarlock spells it; None if the text is none for this quantity."""
    plain = text.strip().lower().replace("µ", "u").replace("μ", "u").replace("²", "2").replace("⁻", "-")
    return _SPELLINGS[quantity].get(re.sub(r"[\s^·*\[\]()]+", "", plain))


def _is_unit(text: str) -> bool:
    return any(measured_unit(text, quantity) for quantity in _SPELLINGS) or text.strip() == ""


def looks_like_units(cells: Sequence[str]) -> bool:
    """True for a line that has units of measurement below the names, and nothing else."""
    filled = [cell.strip() for cell in cells if cell.strip()]
    return sum(_is_unit(cell) for cell in filled) >= max(3, len(filled) // 3) and not any(
        channel_of(cell) for cell in filled
    )


def _by_word(name: str) -> tuple[Quantity, str, str, str, str] | None:
    for quantity, words in _WORDS:
        # A word ends at a character that is no letter, at a capital letter, or at its axis: accX, Acc_X, ACC.X, accx.
        pattern = rf"(?<![A-Za-z])(?i:{words})(?=$|[^A-Za-z]|[XYZW](?![a-z])|[xyzw](?![A-Za-z])|[A-Z][a-z])"
        camel = rf"(?<=[a-z0-9])(?:{'|'.join(_capitalised(words))})(?=$|[^a-z]|[xyzw](?![A-Za-z]))"
        for found in re.finditer(f"{pattern}|{camel}", name):
            if axis := _axis(name, found.end(), _AXES[quantity]):
                begin, end = axis
                return (
                    quantity,
                    name[begin:end].lower(),
                    name[: found.start()],
                    name[found.end() : begin],
                    name[end:],
                )
    return None


def _capitalised(words: str) -> Iterable[str]:
    return (word.capitalize() for word in words.split("|") if word.isalpha())


def _axis(name: str, start: int, letters: str) -> tuple[int, int] | None:
    """Place of the first letter of an axis that stands alone after the quantity."""
    direct = re.compile(rf"[{letters}{letters.upper()}](?![A-Za-z])").match(name, start)
    found = direct or re.compile(
        rf"(?<![A-Za-z0-9])[qQ]?([{letters}{letters.upper()}])(?![A-Za-z0-9])"
    ).search(name, start)
    return (found.end() - 1, found.end()) if found else None


def _by_letter(name: str) -> tuple[Quantity, str, str, str, str] | None:
    found = _SHORT_NAME.search(name)
    if found:
        return _SHORT[found[1].lower()], found[2].lower(), name[: found.start()], "", name[found.end() :]
    found = _SHORT_QUATERNION.search(name)
    if found:
        return "quat", found[1].lower(), name[: found.start()], "", name[found.end() :]
    return None


def _words(text: str) -> list[str]:
    return re.findall(r"[^\W_]+", text)


def _split(word: str) -> list[str]:
    """Parts of a word with capitals inside: "linAcc" gives "lin" and "acc"."""
    return [part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+|\d+", word)]


def _name(words: Sequence[str]) -> str:
    kept = []
    for place, word in enumerate(words):
        plain = word.lower()
        is_numbered = place + 1 < len(words) and words[place + 1].isdigit()
        if plain not in _FILLERS | _QUANTITY_WORDS and (plain != "sensor" or is_numbered):
            kept.append(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", word).lower())
    return "_".join(kept)
