"""Session search: mounts from gravity in postures, axes in movements, and magnetic north if these are insufficient."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.movement import Turning, turning
from oarlock.calibration.session.plan import SessionPlan, SessionStep
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.calibration.session.wahba import DirectionPair, SolvedMount, isotropic, solved_mount
from oarlock.storage.arrays import Floats

ACCEL_STD = 0.01
"""What bias is left in an accelerometer, against gravity."""
LEAST_PURITY = 0.8
LEAST_SWEPT_RAD = 0.35
START_REST_S, EDGE_S = 0.35, 0.05
ROUNDS = 3
"""First as if nothing else moved; then less what the unit before it did, by the mounts of the round before."""
NORTH_STD_RAD = float(np.radians(8.0))
MOUNT_LIMIT_RAD = float(np.radians(4.0))

Moved = dict[tuple[str, str], Turning | None]


@dataclass(frozen=True, eq=False)
class Mounts:
    """Mounts and what speaks for them: solutions and sights by unit, movements by step and unit, norths by both."""

    solved: Mapping[str, SolvedMount]
    sights: Mapping[str, Sequence[DirectionPair]]
    moved: Moved
    norths_rad: Mapping[str, Mapping[str, float]]
    by_north: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MountSearch:
    """The search.

    Args:
        body: links and axes.
        plan: the steps.
        spans: where they lie, s.
        units: corrected rows of each unit.
        nominal: unit -> (3, 3), the mount where the session determines none.
    """

    body: BodyKinematics
    plan: SessionPlan
    spans: Mapping[str, Span]
    units: Mapping[str, UnitRows]
    nominal: Mapping[str, Floats]

    def run(self) -> Mounts:
        """All mounts."""
        ups = {name: self._ups(unit) for name, unit in self.units.items()}
        mounts = {name: solved_mount(ups[name], self.nominal[name]) for name in self.units}
        sights, moved = ups, Moved()
        for k in range(ROUNDS):
            axes, moved = self._axes(mounts, against_parents=k > 0)
            sights = {name: [*ups[name], *axes.get(name, [])] for name in self.units}
            mounts = {name: solved_mount(sights[name], self.nominal[name]) for name in self.units}
        norths = self._norths(mounts)
        loose = [n for n in self.units if mounts[n].worst_std_rad > MOUNT_LIMIT_RAD]
        known = [a for n in norths if n not in loose for a in norths[n].values()]
        by_north = tuple(n for n in loose if norths.get(n)) if known else ()
        for name in by_north:
            azimuth = float(np.angle(np.exp(1j * np.array(known)).mean()))
            sights[name] = [*sights[name], *self._north_sights(name, azimuth)]
            mounts[name] = solved_mount(sights[name], self.nominal[name])
        return Mounts(mounts, sights, moved, self._norths(mounts), by_north)

    def sights(self, unit: UnitRows) -> list[DirectionPair]:
        """What readings say of a mount on the link of the unit's name, as if nothing else had moved."""
        nominal = {unit.name: solved_mount([], self.nominal[unit.name])}
        axes, _ = replace(self, units={unit.name: unit})._axes(nominal, against_parents=False)
        return [*self._ups(unit), *axes.get(unit.name, [])]

    # --- gravity ------------------------------------------------------------------------------------

    def _ups(self, unit: UnitRows) -> list[DirectionPair]:
        found = []
        for step in self._steps("pose", "move"):
            up = self._up_in_sensor(unit, step)
            if up is not None:
                q = self.body.posture(step.pose)
                in_link = self.body.root_from_link(unit.name, q).T @ self.body.up
                own = isotropic(in_link, ACCEL_STD)
                found.append(
                    DirectionPair(step.name, "up", up, in_link, own, isotropic(in_link, self._std(step)))
                )
        return found

    def _up_in_sensor(self, unit: UnitRows, step: SessionStep) -> Floats | None:
        """The mean of a posture, or of the rest in which a movement begins."""
        span = self.spans[step.name]
        stills = unit.still(worn=True, within_s=span)
        longest = max(stills, key=lambda s: s[1] - s[0], default=(0.0, 0.0))
        if step.kind == "move":
            start = (span[0], span[0] + START_REST_S)
            longest = (
                start if any(s[0] <= start[0] + EDGE_S and s[1] >= start[1] for s in stills) else (0.0, 0.0)
            )
        if longest[1] - longest[0] < START_REST_S - EDGE_S:
            return None
        force = unit.accel[unit.rows(longest)].mean(axis=0)
        return np.asarray(force / np.linalg.norm(force))

    # --- movements ----------------------------------------------------------------------------------

    def _axes(
        self, mounts: Mapping[str, SolvedMount], against_parents: bool
    ) -> tuple[dict[str, list[DirectionPair]], Moved]:
        found: dict[str, list[DirectionPair]] = {}
        moved = Moved()
        for step in self._steps("move"):
            q = self.body.posture(step.pose)
            about = None if step.axis is None else np.asarray(step.axis, dtype=np.float64)
            for joint in step.joints:
                for child in (u for u in self.turned(step, joint) if u in self.units):
                    parent = self.body.above(joint, child) if against_parents else None
                    one = self._turning(step, child, parent, q, mounts)
                    moved[step.name, child] = one
                    if one is None or one.purity < LEAST_PURITY or one.swept_rad < LEAST_SWEPT_RAD:
                        continue
                    in_link, posture = self._axis_in_link(step, joint, about, child, q)
                    own = isotropic(in_link, one.std_rad)
                    found.setdefault(child, []).append(
                        DirectionPair(step.name, "axis", one.axis, in_link, own, posture)
                    )
        return found, moved

    def turned(self, step: SessionStep, joint: str) -> list[str]:
        """The units that a movement of a joint turns: the nearest, and those that move with them as one."""
        own = set(self.body.joints[joint])
        return [
            *self.body.below(joint),
            *(u for u in step.units if own <= self.body.turns_with.get(u, set())),
        ]

    def _turning(
        self,
        step: SessionStep,
        child: str,
        parent: str | None,
        q: Floats,
        mounts: Mapping[str, SolvedMount],
    ) -> Turning | None:
        def attitude(unit: str) -> Floats:
            return self.body.root_from_link(unit, q) @ mounts[unit].link_from_sensor

        other = None if parent is None else self.units[parent]
        at_parent = np.eye(3) if parent is None else attitude(parent)
        span = self.spans[step.name]
        return turning(self.units[child], other, span, attitude(child), at_parent, step.first)

    def _axis_in_link(
        self, step: SessionStep, joint: str, about: Floats | None, child: str, q: Floats
    ) -> tuple[Floats, Floats]:
        """The axis in the child's link, and how uncertain the posture of the other joints leaves it."""
        axis, slopes = self.body.axis_in_link(joint, about, child, q)
        turning_ones = [
            k for k, c in enumerate(self.body.model.coordinate_names) if c in self.body.turns_with[child]
        ]
        own = set(self.body.joints[joint]) if about is None else set()
        kept = [k for k in turning_ones if self.body.model.coordinate_names[k] not in own]
        slopes = slopes[kept]
        # A segment keeps the posture's deviation in each direction, however many joints carry it: people steady trunk
        # and head in space (Pozzo, Berthoz and Lefort 1990), so errors of joints do not add up along a chain.
        shares, directions = np.linalg.eigh(slopes.T @ slopes)
        return axis, self._std(step) ** 2 * (directions * np.minimum(shares, 1.0)) @ directions.T

    # --- north --------------------------------------------------------------------------------------

    def _norths(self, mounts: Mapping[str, SolvedMount]) -> dict[str, dict[str, float]]:
        """Unit -> posture -> azimuth of the field in root axes, rad."""
        found: dict[str, dict[str, float]] = {}
        for name, unit in self.units.items():
            for step in self._steps("pose"):
                mag = self._mag(unit, step)
                if mag is not None:
                    q = self.body.posture(step.pose)
                    field = self.body.root_from_link(name, q) @ mounts[name].link_from_sensor @ mag
                    found.setdefault(name, {})[step.name] = self._azimuth(field)
        return found

    def _mag(self, unit: UnitRows, step: SessionStep) -> Floats | None:
        if unit.mag is None:
            return None
        rows = unit.mag[unit.rows(self.spans[step.name])]
        rows = rows[np.isfinite(rows).all(axis=1)]
        return rows.mean(axis=0) if len(rows) >= 4 else None

    def _azimuth(self, field: Floats) -> float:
        forward, side = self._level
        return float(np.arctan2(field @ side, field @ forward))

    def _north_sights(self, name: str, azimuth: float) -> list[DirectionPair]:
        """The level part of the field, in the sensor and, by the other units' azimuth, in the link."""
        found = []
        forward, side = self._level
        north = np.cos(azimuth) * forward + np.sin(azimuth) * side
        for step in self._steps("pose"):
            mag, up = self._mag(self.units[name], step), self._up_in_sensor(self.units[name], step)
            if mag is not None and up is not None:
                level = mag - (mag @ up) * up
                q = self.body.posture(step.pose)
                in_link = self.body.root_from_link(name, q).T @ north
                own = isotropic(in_link, NORTH_STD_RAD)
                posture = isotropic(in_link, self._std(step))
                found.append(
                    DirectionPair(step.name, "north", level / np.linalg.norm(level), in_link, own, posture)
                )
        return found

    # --- what all need ------------------------------------------------------------------------------

    def _steps(self, *kinds: str) -> list[SessionStep]:
        return [s for s in self.plan.steps if s.kind in kinds and s.name in self.spans]

    def _std(self, step: SessionStep) -> float:
        return self.plan.posture_std_rad if step.posture_std_rad is None else step.posture_std_rad

    @property
    def _level(self) -> tuple[Floats, Floats]:
        """Two level directions at right angles, root axes: forward, and from there the way azimuths count."""
        return self.body.forward, np.cross(self.body.up, self.body.forward)
