"""`two_hinges`: mounts of two units between which two hinges lie, such as an elbow, for `calibrate_sagittal`.

The angle between both hinges is constant. Both axes and the relative heading of the units, which have no magnetometers,
are those for which it is (Laidig, Mueller and Seel 2017; Mueller, Begin, Schauer and Seel 2017).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.wahba import DirectionPair, SolvedMount, isotropic, solved_mount
from oarlock.calibration.static.hinge_axes_fit import AxesFit, about_up, fitted_axes
from oarlock.calibration.static.inclination import world_from_sensor
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.streams import ImuStream

STEP_S = 0.05
PARTS = 8
ACCEL_STD = 0.01
"""What bias is left in an accelerometer, against gravity."""
TWIST_STD_RAD = float(np.radians(12.0))
"""How well the second hinge's angle in the posture is known, such as pronation of a hanging arm."""
LARGEST_MISFIT_RAD = float(np.radians(6.0))
LARGEST_STD_RAD = float(np.radians(10.0))
LARGEST_OFF_RAD = float(np.radians(15.0))
"""Between the angle that the movement shows between both hinges and the model's."""
KNOWN_HEADING_STD_RAD = float(np.radians(15.0))
"""With a larger one the axes of the hinges are wrong in the units' axes by more than joints of people forgive."""
UPRIGHT = float(np.cos(np.radians(30.0)))
"""Least cosine between an axis and the vertical with which an unknown heading turns the unit about this axis."""


@dataclass(frozen=True, eq=False)
class TwoHinges:
    """Two units with two hinges between them, and what their movement shows.

    Args:
        units: above, below.
        joints: above, below.
        mounts: unit -> the mount; empty if the movement does not determine the axes.
        misfit_rad: root mean square of the change of the angle between the axes.
        off_rad: how far the angle between the axes is from the model's.
        stds_rad: (2,) of both axes.
        refused: why there are no mounts; empty if there are.
        upright: whether the second axis is the lower segment's long axis, vertical in the posture, as in an elbow.
    """

    units: tuple[str, str]
    joints: tuple[str, str]
    mounts: Mapping[str, SolvedMount]
    misfit_rad: float
    off_rad: float
    stds_rad: Floats
    refused: str
    upright: bool

    def is_ball(self, heading_stds_rad: Mapping[str, float]) -> bool:
        """Whether the axes are so uncertain that a ball describes the joint better.

        Args:
            heading_stds_rad: unit -> standard deviation of the turn of its mount about the vertical.
        """
        unknown = max(heading_stds_rad[n] for n in self.units) > KNOWN_HEADING_STD_RAD
        return bool(self.refused) and self.upright and unknown

    def noted(self) -> dict[str, object]:
        """Texts and numbers only, so that a file can hold them."""
        return {
            "units": list(self.units), "joints": list(self.joints), "misfit_rad": self.misfit_rad,
            "angle_off_rad": self.off_rad, "axis_stds_rad": self.stds_rad.tolist(), "refused": self.refused,
        }  # fmt: skip


def two_hinges(
    model: Model,
    body: BodyKinematics,
    q: Floats,
    units: Mapping[str, ImuStream],
    nominal: Mapping[str, Floats],
    still_s: tuple[float, float],
    posture_std_rad: float,
) -> list[TwoHinges]:
    """All pairs of units with two hinges between them.

    Args:
        model: with axes and limits.
        body: links of the units.
        q: (n,) the still posture.
        units: corrected streams.
        nominal: unit -> (3, 3) mount where nothing else determines it.
        still_s: the stretch in the posture.
        posture_std_rad: how well it is taken up.
    """
    return [
        _Pair(model, body, q, pair, joints, still_s, posture_std_rad).found(units, nominal)
        for pair, joints in _pairs(model, body)
    ]


def _pairs(model: Model, body: BodyKinematics) -> Iterator[tuple[tuple[str, str], tuple[str, str]]]:
    """Units and hinges between them, each from above to below."""
    told = model.describe().joints
    for child in body.units:
        parent = body.unit_above(child, body.units)
        if parent is None:
            continue
        own = body.turns_with[child] - body.turns_with[parent]
        joints = [j for j in told if own & set(j.coordinates)]
        if len(joints) != 2 or any(j.kind != "hinge" for j in joints):
            continue
        # Joints stand in the order of the model: the first hinge carries the second.
        first, second = joints
        yield (parent, child), (first.name, second.name)


@dataclass(frozen=True, eq=False)
class _Pair:
    model: Model
    body: BodyKinematics
    q: Floats
    units: tuple[str, str]
    joints: tuple[str, str]
    still_s: tuple[float, float]
    posture_std_rad: float

    def found(self, units: Mapping[str, ImuStream], nominal: Mapping[str, Floats]) -> TwoHinges:
        streams = [units[n] for n in self.units]
        start = max(s.time_s[0] for s in streams)
        time_s = np.arange(start, min(s.time_s[-1] for s in streams), STEP_S)
        rest = (time_s >= self.still_s[0]) & (time_s <= self.still_s[1])
        turns = [world_from_sensor(s, self.still_s, time_s) for s in streams]
        ups = [t[rest].mean(axis=0)[2] for t in turns]
        ups = [u / np.linalg.norm(u) for u in ups]
        first, second = self._axes_in_links
        angle = float(first[1] @ second[1])
        fit = fitted_axes(time_s, turns[0], turns[1], angle)
        fits = []
        for part in np.array_split(np.arange(len(time_s)), PARTS):
            upper, lower = (np.delete(t, part, axis=0) for t in turns)
            fits.append(fitted_axes(np.delete(time_s, part), upper, lower, angle, fit))
        squares = np.array([fit.apart(f) ** 2 for f in fits]).sum(axis=0)
        stds = np.sqrt((PARTS - 1) / PARTS * squares + fit.stds_rad**2)
        off = abs(float(np.arccos(np.clip(fit.cosine, -1, 1)) - np.arccos(np.clip(angle, -1, 1))))
        refused = self._refused(fit, stds, off)
        mounts = {} if refused else self._mounts(fit, stds, ups, turns, rest, nominal)
        up = self.body.root_from_link(self.units[1], self.q).T @ self.body.up
        upright = bool(abs(up @ second[1]) > UPRIGHT)
        return TwoHinges(self.units, self.joints, mounts, fit.misfit_rad, off, stds, refused, upright)

    @cached_property
    def _axes_in_links(self) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
        """Of each hinge its axis in the link above and in the link below, in the posture."""
        child = self.units[1]
        links = [self.body.root_from_link(n, self.q) for n in self.units]
        below = [self.body.axis_in_link(j, None, child, self.q)[0] for j in self.joints]
        above = [links[0].T @ links[1] @ axis for axis in below]
        return (above[0], below[0]), (above[1], below[1])

    def _refused(self, fit: AxesFit, stds: Floats, off: float) -> str:
        figures = [
            ("the angle between the axes, which two hinges keep, changes by", fit.misfit_rad, LARGEST_MISFIT_RAD),
            ("the angle between the axes differs from the model's by", off, LARGEST_OFF_RAD),
            ("an axis has a standard deviation of", float(stds.max()), LARGEST_STD_RAD),
        ]  # fmt: skip
        return "; ".join(
            f"{text} {np.degrees(is_rad):.0f} deg, more than {np.degrees(most):.0f} deg"
            for text, is_rad, most in figures
            if not is_rad <= most
        )

    def _mounts(
        self,
        fit: AxesFit,
        stds: Floats,
        ups: list[Floats],
        turns: list[Floats],
        rest: np.ndarray[tuple[int], np.dtype[np.bool_]],
        nominal: Mapping[str, Floats],
    ) -> dict[str, SolvedMount]:
        """By the sense of both axes with which the posture and the limits agree best."""
        first, second = self._axes_in_links
        in_links = [self.body.root_from_link(n, self.q).T @ self.body.up for n in self.units]
        heading = about_up(fit.heading_rad[rest].mean())
        seen = turns[1][rest].mean(axis=0).T @ heading.T @ turns[0][rest].mean(axis=0) @ fit.first
        seen = seen / np.linalg.norm(seen)
        best: tuple[float, dict[str, SolvedMount]] | None = None
        for one, two in product((1.0, -1.0), repeat=2):
            sights = {
                self.units[0]: [
                    _up(ups[0], in_links[0], self.posture_std_rad),
                    _axis(one * fit.first, first[0], float(stds[0]), 0.0),
                ],
                self.units[1]: [
                    _up(ups[1], in_links[1], self.posture_std_rad),
                    _axis(two * fit.second, second[1], float(stds[1]), 0.0),
                    _axis(one * seen, first[1], float(stds[0]), TWIST_STD_RAD),
                ],
            }
            solved = {n: solved_mount(s, nominal[n]) for n, s in sights.items()}
            cost = sum(float(np.square(m.off_stds).sum()) for m in solved.values())
            cost += self._beyond(solved, fit, turns) / self.posture_std_rad**2
            if best is None or cost < best[0]:
                best = cost, solved
        assert best is not None
        return best[1]

    def _beyond(self, solved: Mapping[str, SolvedMount], fit: AxesFit, turns: list[Floats]) -> float:
        """Mean square of what the first hinge turns beyond its limits, rad2."""
        above, below = (solved[n].link_from_sensor for n in self.units)
        first, second = self._axes_in_links
        from_below = np.swapaxes(turns[0], 1, 2) @ about_up(fit.heading_rad) @ turns[1]
        now = (above @ from_below @ below.T) @ second[1]
        side = np.cross(first[0], second[0])
        level = second[0] - first[0] * (first[0] @ second[0])
        joint = next(j for j in self.model.describe().joints if j.name == self.joints[0])
        angle = np.arctan2(now @ side, now @ level) + float(np.ravel(joint.rest)[0])
        return float(
            (np.maximum(0.0, np.maximum(joint.limits[0] - angle, angle - joint.limits[1])) ** 2).mean()
        )


def _up(in_sensor: Floats, in_link: Floats, posture_std_rad: float) -> DirectionPair:
    return DirectionPair(
        "posture",
        "up",
        in_sensor,
        in_link,
        isotropic(in_link, ACCEL_STD),
        isotropic(in_link, posture_std_rad),
    )


def _axis(in_sensor: Floats, in_link: Floats, std_rad: float, posture_std_rad: float) -> DirectionPair:
    own, posture = isotropic(in_link, std_rad + 1e-3), isotropic(in_link, posture_std_rad)
    return DirectionPair("movement", "axis", in_sensor, in_link, own, posture)
