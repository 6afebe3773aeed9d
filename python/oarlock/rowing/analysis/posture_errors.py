"""Uncertainty of technique: each error source is varied by its standard deviation, one at a time.

Errors of a track are correlated in time (mounts, lengths, skin), so they do not average out over a stroke. The error of
an angle is modelled as a constant part, a part with the period of the stroke, and a small part of higher frequency:

    e = std(t) (a + (b cos u + c sin u) / sqrt 2 + 0.3 (d cos 4 u + f sin 4 u))

with u = 0 at the catch, pi at the finish, and a, b, c, d, f of variance 1. Its mean square is 1.6 std^2: numbers are
read at the ends of the stroke, where squared errors were 1.5 times the variance (finish, nine joints, ten field
simulations). Errors of different joints are independent. With f0 the number, f+ and f- with one source moved by plus
and minus one deviation, and c = f+ + f- - 2 f0, a source adds ((f+ - f-) / 2)^2 + 0.75 c^2 to the mean square error:
exact for a quadratic function of a normal error. Errors of rates change within a quarter of a stroke.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from oarlock import Model
from oarlock.rowing.analysis.rower_places import RowerFrames
from oarlock.rowing.analysis.stroke_grid import POINTS, CoordinateCurves, PhaseGrid
from oarlock.rowing.analysis.stroke_values import (
    Posture,
    Values,
    along_m,
    grip_names,
    grips,
    shoulders,
    stroke_values,
)
from oarlock.storage.arrays import Floats

_ROUND = 2.0 * np.pi * np.arange(POINTS) / (POINTS - 1)
_QUICK = (np.cos(4.0 * _ROUND), np.sin(4.0 * _ROUND))
SHAPES = (
    np.ones(POINTS),
    *(np.sqrt(0.5) * shape for shape in (np.cos(_ROUND), np.sin(_ROUND))),
    *(0.3 * shape for shape in _QUICK),
)
"""Of the parts of an error over a stroke, (POINTS,) each."""
_AT_ONE_TIME = np.sqrt(1.59)
"""All together, of joints whose numbers are of one time."""
_TOGETHER = ("l_cl", "l_ua", "l_fa", "l_ha")


@dataclass(frozen=True, eq=False)
class Events:
    """Catch, finish and next catch, (N,) each, with their standard deviations, s."""

    catch_s: Floats
    finish_s: Floats
    end_s: Floats
    catch_std_s: Floats
    finish_std_s: Floats
    end_std_s: Floats

    def part(self, rows: slice) -> Events:
        """Some of the strokes."""
        return Events(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def moved(self, name: str, sign: float) -> PhaseGrid:
        """The grid when one of the events is off by its standard deviation."""
        times = {key: getattr(self, f"{key}_s") for key in ("catch", "finish", "end")}
        times[name] = times[name] + sign * getattr(self, f"{name}_std_s")
        return PhaseGrid.of(times["catch"], times["finish"], times["end"])


@dataclass(frozen=True, eq=False)
class Scatter:
    """Values of technique with standard deviations, for some strokes of a track."""

    rower: RowerFrames
    course: CoordinateCurves
    events: Events
    zero_std: float
    lengths_std: dict[str, float]

    def values_and_stds(self) -> tuple[Values, Values]:
        """Numbers (N,) and curves (N, POINTS) by name, and their standard deviations."""
        grid = PhaseGrid.of(self.events.catch_s, self.events.finish_s, self.events.end_s)
        q, qd, stds, rate_stds = self.course.at(grid)
        posture = _posture(self.rower, grid, q, qd)
        values = stroke_values(posture)
        squares = {name: np.zeros_like(value) for name, value in values.items()}
        for above, below in self._moved(posture, stds, rate_stds):
            up, down = stroke_values(above), stroke_values(below)
            for name, value in values.items():
                half, bend = 0.5 * (up[name] - down[name]), up[name] + down[name] - 2.0 * value
                squares[name] += np.nan_to_num(half**2 + 0.75 * bend**2)
        return values, {
            name: np.where(np.isfinite(values[name]), np.sqrt(s), np.nan) for name, s in squares.items()
        }

    def _moved(self, posture: Posture, stds: Floats, rate_stds: Floats) -> Iterator[tuple[Posture, Posture]]:
        yield from self._coordinates(posture, stds)
        yield from self._rates(posture, rate_stds)
        yield from self._lengths(posture)
        for name in ("catch", "finish", "end"):
            if np.isfinite(getattr(self.events, f"{name}_std_s")).any():
                yield self._at(name, 1.0), self._at(name, -1.0)

    def _at(self, event: str, sign: float) -> Posture:
        grid = self.events.moved(event, sign)
        q, qd, _, _ = self.course.at(grid)
        return _posture(self.rower, grid, q, qd)

    def _coordinates(self, posture: Posture, stds: Floats) -> Iterator[tuple[Posture, Posture]]:
        names = list(self.rower.model.coordinate_names)
        body = [name for name in ("seat", *self.rower.trunk_joints) if name in names]
        arms = zip(self.rower.arm_joints("r"), self.rower.arm_joints("l"), strict=True)
        groups: list[tuple[tuple[str, ...], Floats]] = [((name,), shape) for name in body for shape in SHAPES]
        groups += [(pair, np.full(POINTS, _AT_ONE_TIME)) for pair in arms]
        groups += [((name,), np.ones(POINTS)) for name in self.rower.handle_joints]
        for group, shape in groups:
            error = np.zeros_like(posture.q)
            for name in group:
                column = names.index(name)
                own = stds[..., column]
                if name in self.rower.handle_joints:
                    own = np.hypot(own, self.zero_std)
                error[..., column] = own * shape
            if error.any():
                yield _with_places(posture, posture.q + error), _with_places(posture, posture.q - error)

    def _lengths(self, posture: Posture) -> Iterator[tuple[Posture, Posture]]:
        for group in _length_groups(self.lengths_std):
            pair = [self._with_lengths(posture, group, sign) for sign in (1.0, -1.0)]
            yield pair[0], pair[1]

    def _with_lengths(self, posture: Posture, group: list[str], sign: float) -> Posture:
        own = self.rower.model
        changed = {name: own.parameters[name] + sign * self.lengths_std[name] for name in group}
        return _with_places(posture, posture.q, own.with_parameters(changed))

    def _rates(self, posture: Posture, rate_stds: Floats) -> Iterator[tuple[Posture, Posture]]:
        names = list(self.rower.model.coordinate_names)
        moves = self.rower.moves(posture.q)
        seat, shoulder = _along(moves["seat"]), _along(shoulders(moves))
        for name in ("seat", *self.rower.trunk_joints):
            if name not in names or not rate_stds[..., names.index(name)].any():
                continue
            column = names.index(name)
            of_seat, of_shoulder = (rate_stds[..., column] * by[..., column] for by in (seat, shoulder))
            for shape in _QUICK:
                more, less = (
                    _faster(posture, sign * of_seat * shape, sign * of_shoulder * shape)
                    for sign in (1.0, -1.0)
                )
                yield more, less


def _length_groups(stds: dict[str, float]) -> list[list[str]]:
    """Lengths that are varied together: left and right arms enter different numbers."""
    groups: dict[str, list[str]] = {}
    for name, std in stds.items():
        if std > 0.0:
            groups.setdefault(name[:-2] if name[:-2] in _TOGETHER else name, []).append(name)
    return list(groups.values())


def _posture(rower: RowerFrames, grid: PhaseGrid, q: Floats, qd: Floats) -> Posture:
    places, rates = rower.places(q), np.nan_to_num(qd)
    held = grip_names(places)
    moves = rower.moves(q, held.values())

    def speed(move: Floats) -> Floats:
        return np.asarray(np.sum(_along(move) * rates, axis=-1))

    return Posture(
        rower,
        grid,
        q,
        places,
        speed(moves["seat"]),
        speed(shoulders(moves)),
        {side: speed(moves[name]) for side, name in held.items()},
    )


def _along(move: Floats) -> Floats:
    """Way toward the bow per unit of each coordinate."""
    return np.asarray(-move[..., 2, :])


def _with_places(posture: Posture, q: Floats, model: Model | None = None) -> Posture:
    """In another posture, and as much faster as that posture moves away from the first."""
    places, grid = posture.rower.places(q, model), posture.grid

    def faster(one: Floats, other: Floats) -> Floats:
        return grid.slope(along_m(other) - along_m(one))

    own, moved = grips(posture.places), grips(places)
    return Posture(
        posture.rower,
        grid,
        q,
        places,
        posture.seat_speed_m_s + faster(posture.places["seat"], places["seat"]),
        posture.shoulder_speed_m_s + faster(shoulders(posture.places), shoulders(places)),
        {side: posture.handle_speed_m_s[side] + faster(own[side], moved[side]) for side in own},
    )


def _faster(posture: Posture, seat: Floats, shoulder: Floats) -> Posture:
    return Posture(
        posture.rower,
        posture.grid,
        posture.q,
        posture.places,
        posture.seat_speed_m_s + seat,
        posture.shoulder_speed_m_s + shoulder,
        posture.handle_speed_m_s,
    )
