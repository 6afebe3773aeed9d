"""Units in files and their conversion to the units of the package (rad/s, m/s2, uT, m, rad)."""

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.suggest import did_you_mean

STANDARD_GRAVITY_M_S2 = 9.80665

GYRO = ("rad/s", "deg/s")
ACCEL = ("m/s2", "g", "mg", "mm/s2")
MAG = ("uT", "gauss", "mG", "nT", "T")
LENGTH = ("m", "cm", "mm")
ANGLE = ("rad", "deg")

# held = value * factor / divisor: dividing keeps 1 mm at exactly 0.001 m, which a factor of 0.001 does not.
_CONVERSIONS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "rad/s": (1.0, 1.0),
        "deg/s": (math.pi, 180.0),
        "m/s2": (1.0, 1.0),
        "g": (STANDARD_GRAVITY_M_S2, 1.0),
        "mg": (STANDARD_GRAVITY_M_S2, 1000.0),
        "mm/s2": (1.0, 1000.0),
        "uT": (1.0, 1.0),
        "gauss": (100.0, 1.0),
        "mG": (1.0, 10.0),
        "nT": (1.0, 1000.0),
        "T": (1e6, 1.0),
        "m": (1.0, 1.0),
        "cm": (1.0, 100.0),
        "mm": (1.0, 1000.0),
        "rad": (1.0, 1.0),
        "deg": (math.pi, 180.0),
    }
)

_SPELLINGS: Mapping[str, str] = MappingProxyType(
    {
        "rad/sec": "rad/s",
        "dps": "deg/s",
        "°/s": "deg/s",
        "m/s/s": "m/s2",
        "G": "gauss",
        "Gauss": "gauss",
        "°": "deg",
    }
)


def plain_unit(text: str) -> str:
    """A unit as Oarlock spells it: "m/s^2" and "m/s²" give "m/s2", "µT" gives "uT"."""
    unit = text.strip().replace("²", "2").replace("^2", "2").replace("µ", "u").replace("μ", "u")
    return _SPELLINGS.get(unit, unit)


def to_held_unit(values: Floats, unit: str) -> Floats:
    """Values in `unit`, as rad/s, m/s2, uT, m or rad; unchanged bit for bit where it is that unit already."""
    factor, divisor = _CONVERSIONS[unit]
    with np.errstate(over="ignore"):  # a stream refuses infinite readings by name
        scaled = values if factor == 1.0 else values * factor
        return scaled if divisor == 1.0 else scaled / divisor


def from_held_unit(values: Floats, unit: str) -> Floats:
    """What `to_held_unit` undoes: values in rad/s, m/s2, uT, m or rad as values in `unit`."""
    factor, divisor = _CONVERSIONS[unit]
    scaled = values if divisor == 1.0 else values * divisor
    return scaled if factor == 1.0 else scaled / factor


def unknown_unit_text(unit: str, valid: tuple[str, ...]) -> str:
    """What to say of a unit that is not among the valid ones."""
    return f'the unit "{unit}" does not fit here. {did_you_mean(unit, valid)} Units: {", ".join(valid)}.'
