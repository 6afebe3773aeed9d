"""Sensor faults that `suspects` tests, each as the change of the recording that corrects it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations, product
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from oarlock.evaluation.suspects.suspect import axes_text, exchange_text, factor_text, stuck_text, turn_text
from oarlock.recording.gyro_scale import gyro_per_gravity_turn
from oarlock.recording.plausibility import GYRO_MAX_RAD_S
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model

UNIT_FIELDS = ("gyro_rad_s", "accel_m_s2", "mag_ut")
GRAVITY_M_S2 = 9.80665
LESS_USUAL, RARE = 1.1, 1.25
"""Factors by which an uncommon or rare fault must reduce the misfit more than a common one."""
MOST_DOUBLE = 6
"""Double exchanges are tried among at most this number of streams."""


@dataclass(frozen=True, eq=False)
class FaultCorrection:
    """One fault, and the change of the readings that corrects it.

    Args:
        fault: "exchanged", "unit", "sign", "turned", "axes".
        streams: the affected streams.
        text: the symptom and the remedy, in one or two sentences.
        names: stream -> the name it should have.
        fields: the changed quantities; empty for an exchange.
        matrix: (3, 3) correct axes from recorded axes, or a factor.
        rarity: 1 for common faults, larger for rare ones.
    """

    fault: str
    streams: tuple[str, ...]
    text: str
    names: Mapping[str, str] = field(default_factory=dict)
    fields: tuple[str, ...] = ()
    matrix: Floats | float = 1.0
    rarity: float = 1.0

    @property
    def of_force(self) -> Floats | None:
        """(3, 3) that readings of accelerometers are multiplied by; None if they stay."""
        if "accel_m_s2" not in self.fields:
            return None
        return self.matrix * np.eye(3) if isinstance(self.matrix, float) else self.matrix

    def applied(self, recording: Recording) -> Recording:
        """The recording with the fault corrected."""
        return Recording([self._mended(s) if s.name in self.streams else s for s in recording.streams])

    def _mended(self, stream: Stream) -> Stream:
        values = {
            n: changed_rows(v, self.matrix) if n in self.fields else v for n, v in stream.values.items()
        }
        name = self.names.get(stream.name, stream.name)
        return type(stream)(name, stream.time_s, **values)  # type: ignore[arg-type]


def changed_rows(rows: Floats, by: Floats | float) -> Floats:
    """Rows times a factor, or turned by a matrix (3, 3)."""
    return np.asarray(rows * by if isinstance(by, float) else rows @ by.T)


def exchanges(groups: Iterable[Sequence[str]]) -> Iterator[FaultCorrection]:
    """Exchanges of two streams of one kind."""
    for group in groups:
        yield from (_exchanged((pair,)) for pair in combinations(group, 2))


def exchanges_of_two(groups: Iterable[Sequence[str]]) -> Iterator[FaultCorrection]:
    """Double exchanges within one kind, if there are few streams."""
    for group in groups:
        doubles = combinations(combinations(group, 2), 2) if len(group) <= MOST_DOUBLE else ()
        yield from (_exchanged(two) for two in doubles if len({n for pair in two for n in pair}) == 4)


def value_changes(
    angles: Sequence[Stream], places: Sequence[Stream], units: bool
) -> Iterator[FaultCorrection]:
    """Signs, or with `units` wrong units, of encoders: one, two or all of a kind.

    Units are tried if values are large.
    """
    for group, factors in ((angles, _ANGLES), (places, _PLACES)):
        for what, factor, least in factors:
            if units != (factor != -1.0):
                continue
            names = [s.name for s in group if _largest(s.values["value"]) > least]
            for together in _together(names):
                text = factor_text(together, "value", what, factor)
                rarity = 1.0 if len(together) == 1 or units else LESS_USUAL if len(together) == 2 else RARE
                fault = "unit" if units else "sign"
                yield FaultCorrection(fault, together, text, {}, ("value",), factor, rarity)


def stuck_values(streams: Sequence[Stream]) -> Iterator[FaultCorrection]:
    """Encoders with constant readings: their readings are left out."""
    for stream in streams:
        values = stream.values["value"]
        there = values[np.isfinite(values)]
        if len(there) > 1 and (there == there[0]).all():
            text = stuck_text(stream.name, float(there[0]))
            yield FaultCorrection("stuck", (stream.name,), text, {}, ("value",), float("nan"), RARE)


def unit_signs(names: Sequence[str], together: bool) -> Iterator[FaultCorrection]:
    """Signs of gyroscopes and accelerometers: of each unit, or of all units."""
    for streams in [tuple(names)] if together else [(name,) for name in names]:
        for quantity, what in _UNIT_SIGNS:
            yield FaultCorrection(
                "sign", streams, factor_text(streams, quantity, what, -1.0), {}, (quantity,), -1.0
            )


def unit_factors(units: Sequence[ImuStream]) -> Iterator[FaultCorrection]:
    """Wrong units of gyroscopes and accelerometers, if values are large or small: of each inertial unit, or of all."""
    for quantity, what, factor, low, high in _UNIT_FACTORS:
        there = [s for s in units if quantity in s.values and low < _largest(s.values[quantity]) < high]
        if what == "in deg/s":
            there = [s for s in there if _may_be_degrees(s)]
        for streams in _alone_and_all([s.name for s in there]):
            yield FaultCorrection(
                "unit", streams, factor_text(streams, quantity, what, factor), {}, (quantity,), factor
            )


def gyro_units(names: Sequence[str]) -> Iterator[FaultCorrection]:
    """Wrong units of the gyroscope of each inertial unit, however large its values are."""
    for quantity, what, factor, *_ in _UNIT_FACTORS:
        for name in names if quantity == "gyro_rad_s" else ():
            yield FaultCorrection(
                "unit", (name,), factor_text((name,), quantity, what, factor), {}, (quantity,), factor
            )


def _may_be_degrees(unit: ImuStream) -> bool:
    """False where gravity in the accelerometer turns at the gyroscope's rate, or a limb merely turns fast.

    Movement that is slow enough to stay below 40 deg/s shows in the direction of gravity.
    """
    ratio = gyro_per_gravity_turn(unit)
    return _largest(unit.values["gyro_rad_s"]) > GYRO_MAX_RAD_S if ratio is None else ratio > MANY_TIMES


def turns(names: Sequence[str]) -> Iterator[FaultCorrection]:
    """An inertial unit rotated on its link by quarter turns, or with two axes exchanged or one reversed."""
    for streams in [(name,) for name in names]:
        for matrix in PROPER:
            half = abs(np.trace(matrix) + 1.0) < 0.5
            text = turn_text(streams, matrix)
            yield FaultCorrection(
                "turned", streams, text, {}, UNIT_FIELDS, matrix, 1.0 if half else LESS_USUAL
            )
        for matrix in MIRRORS:
            yield FaultCorrection(
                "axes", streams, axes_text(streams, UNIT_FIELDS, matrix), {}, UNIT_FIELDS, matrix, RARE
            )
        for quantity in UNIT_FIELDS[:2]:
            for matrix in MIRRORS:
                text = axes_text(streams, (quantity,), matrix)
                yield FaultCorrection("axes", streams, text, {}, (quantity,), matrix, RARE)


def compass_changes(names: Sequence[str], together: bool) -> Iterator[FaultCorrection]:
    """Axes and units of magnetometers: of each inertial unit, or of all."""
    for streams in [tuple(names)] if together else [(name,) for name in names]:
        for matrix in (*PROPER, *MIRRORS, -np.eye(3)):
            text = axes_text(streams, ("mag_ut",), matrix)
            half = np.count_nonzero(np.diag(matrix)) == 3
            yield FaultCorrection("axes", streams, text, {}, ("mag_ut",), matrix, 1.0 if half else LESS_USUAL)
        for what, factor in _COMPASS_UNITS:
            text = factor_text(streams, "mag_ut", what, factor)
            yield FaultCorrection("unit", streams, text, {}, ("mag_ut",), factor)


@dataclass(frozen=True, eq=False)
class LikeStreams:
    """Streams by kind: inertial units, encoders of angles, encoders of positions."""

    units: tuple[ImuStream, ...]
    angles: tuple[Stream, ...]
    places: tuple[Stream, ...]

    @classmethod
    def of(cls, model: Model, streams: Sequence[Stream]) -> LikeStreams:
        """Sorts the streams by the joints that they read in the model."""
        described = model.describe()
        slides = {joint.name for joint in described.joints if joint.kind == "slide"}
        joint_of = {s.name: s.joint for s in described.encoders}
        scalars = [s for s in streams if s.kind == "scalar"]
        places = [s.name for s in scalars if joint_of.get(s.name, s.name) in slides]
        return cls(
            tuple(s for s in streams if isinstance(s, ImuStream)),
            tuple(s for s in scalars if s.name not in places),
            tuple(s for s in scalars if s.name in places),
        )


def _largest(rows: Floats) -> float:
    """Largest magnitude; 0 without readings."""
    sizes = np.abs(rows) if rows.ndim == 1 else np.sqrt((rows**2).sum(axis=1))
    sizes = sizes[np.isfinite(sizes)]
    return float(sizes.max()) if sizes.size else 0.0


def _alone_and_all(names: Sequence[str]) -> list[tuple[str, ...]]:
    return [(name,) for name in names] + ([tuple(names)] if len(names) > 1 else [])


def _together(names: Sequence[str]) -> list[tuple[str, ...]]:
    found: list[tuple[str, ...]] = [(name,) for name in names]
    if len(names) <= MOST_DOUBLE:
        found += list(combinations(names, 2))
    return found + ([tuple(names)] if len(names) > 2 else [])


def _exchanged(pairs: Sequence[tuple[str, str]]) -> FaultCorrection:
    names = {one: other for a, b in pairs for one, other in ((a, b), (b, a))}
    streams = tuple(name for pair in pairs for name in pair)
    return FaultCorrection(
        "exchanged", streams, exchange_text(pairs), names, rarity=1.0 if len(pairs) == 1 else RARE
    )


def _signed_permutations() -> list[Floats]:
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            found.append(matrix)
    return found


PROPER = tuple(m for m in _signed_permutations() if np.linalg.det(m) > 0 and np.trace(m) < 2.5)
"""The 23 rotations by quarter and half turns about an axis and by third turns about a diagonal."""
_REFLECTED = [m for m in _signed_permutations() if np.linalg.det(m) < 0]
MIRRORS = tuple(
    m for m in _REFLECTED if not (m < 0).any() or ((m < 0).sum() == 1 and np.count_nonzero(np.diag(m)) == 3)
)
"""The 6 reflections with two axes exchanged or one reversed."""

# With the value that a reading must exceed for the fault to be visible.
_ANGLES = (("with the wrong sign", -1.0, 0.0), ("in degrees", pi / 180.0, 2.0))
_PLACES = (("with the wrong sign", -1.0, 0.0), ("in cm", 0.01, 3.0), ("in mm", 0.001, 20.0))
_UNIT_SIGNS = (
    ("gyro_rad_s", "with the wrong sign"),
    ("accel_m_s2", "with the sign of gravity (it reads -9.8 m/s2 upwards at rest)"),
)
_UNIT_FACTORS = (
    ("gyro_rad_s", "in deg/s", pi / 180.0, 5.0, np.inf),
    ("gyro_rad_s", "converted from deg/s twice", 180.0 / pi, 0.0, 0.6),
    ("accel_m_s2", "in g", GRAVITY_M_S2, 0.0, 6.0),
    ("accel_m_s2", "in mg", GRAVITY_M_S2 / 1000.0, 500.0, np.inf),
    ("accel_m_s2", "converted from g twice", 1.0 / GRAVITY_M_S2, 40.0, np.inf),
)
MANY_TIMES = 10.0
"""A gyroscope that reads so many times the rate of gravity may be in deg/s, which is 57 times."""
_COMPASS_UNITS = (("in gauss", 100.0), ("in mG", 0.1), ("in nT", 0.001))
