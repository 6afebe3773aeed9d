"""Session search: biases, scales and iron of one inertial unit, its corrected readings, and the checks of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from oarlock.calibration.session.accelerometer import BIAS_LIMIT_M_S2, LEAST_ATTITUDES, AccelRest, accel_rest
from oarlock.calibration.session.checks import KEPT, PASSED, REDO, Check, numbers, within
from oarlock.calibration.session.gyroscope import BIAS_LIMIT_RAD_S, GyroRest, gyro_rest
from oarlock.calibration.session.magnetometer import NORM_LIMIT, OFFSET_LIMIT_UT, MagFit, mag_fit
from oarlock.calibration.session.plan import SessionPlan
from oarlock.calibration.session.timing import stills_of
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.model.description import ImuDescription
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import true_readings

NOISE_LIMIT = 3.0
"""A unit this many times as noisy as the model says."""


@dataclass(frozen=True, eq=False)
class SensorSearch:
    """The search in one unit: gyroscope, accelerometer and magnetometer at rest and in all directions."""

    rows: UnitRows
    gyro: GyroRest | None
    accel: AccelRest | None
    mag: MagFit | None

    @classmethod
    def of(cls, unit: UnitRows, plan: SessionPlan, spans: Mapping[str, Span], gravity: float) -> SensorSearch:
        """Looks at the rests of the plan's steps, and for the magnetometer at the turns.

        Without turns the magnetometer's readings in all steps count if the plan gives their times, else all readings.
        """
        stills = stills_of(unit, plan, spans)
        turns = [spans[s.name] for s in plan.steps if s.kind == "turn" and s.name in spans]
        if not turns and all(s.span_s is not None for s in plan.steps):
            turns = sorted(spans.values())
        return cls(
            unit, gyro_rest(unit, stills), accel_rest(unit, stills, gravity), mag_fit(unit, turns, stills)
        )

    def fields(self) -> dict[str, Any]:
        """Field of `Calibration` -> value, of all that is known."""
        found: dict[str, Any] = {}
        if self.gyro is not None:
            found |= {"gyro_biases_rad_s": self.gyro.bias_rad_s, "gyro_bias_stds_rad_s": self.gyro.std_rad_s}
        if self.accel is not None and self.accel.known:
            found |= {"accel_biases_m_s2": self.accel.bias_m_s2, "accel_scales": self.accel.scale}
        if self.mag is not None and self.mag.known:
            found |= {"mag_offsets_ut": self.mag.offset_ut, "mag_matrices": self.mag.matrix}
        return found

    def corrected(self, calibration: Calibration) -> UnitRows:
        """The rows with the calibration's corrections applied."""
        rows = self.rows
        gyro = true_readings(calibration, rows.name, "gyro_rad_s", rows.gyro)
        accel = true_readings(calibration, rows.name, "accel_m_s2", rows.accel)
        mag = None if rows.mag is None else true_readings(calibration, rows.name, "mag_ut", rows.mag)
        return replace(rows, gyro=gyro, accel=accel, mag=mag)

    def checks(self, described: ImuDescription) -> list[Check]:
        """The lines of the page."""
        return [*self._gyro_checks(described), self._accel_check(), *self._mag_checks()]

    def _gyro_checks(self, described: ImuDescription) -> list[Check]:
        name, rest = self.rows.name, self.gyro
        if rest is None:
            sentence = "The unit never rested for a second: lay it down for five seconds and record again."
            return [
                Check(
                    "rest",
                    name,
                    "gyroscope's bias",
                    "-",
                    np.nan,
                    1e3 * BIAS_LIMIT_RAD_S,
                    "mrad/s",
                    REDO,
                    sentence,
                )
            ]
        std = float(rest.std_rad_s.max())
        outcome = within(std, rest.limit_rad_s)
        sentence = (
            f"It rested for {rest.rest_s:.0f} s, which is enough."
            if outcome == PASSED
            else f"It rested for {rest.rest_s:.0f} s only, or was touched: lay it down for longer."
        )
        text = f"{numbers(1e3 * rest.bias_rad_s, 1)} mrad/s"
        found = [
            Check(
                "rest",
                name,
                "gyroscope's bias",
                text,
                1e3 * std,
                1e3 * BIAS_LIMIT_RAD_S,
                "mrad/s",
                outcome,
                sentence,
            )
        ]
        expected = described.rest_std_rad_s or described.gyro_std_rad_s
        if expected:
            noise = float(rest.noise_rad_s.max())
            quiet = noise <= NOISE_LIMIT * expected
            sentence = (
                "As quiet as the model expects."
                if quiet
                else "Much noisier than the model expects. Check that it lay still; otherwise increase the noise in "
                "the model file."
            )
            text = f"{1e3 * noise:.1f} mrad/s a sample"
            limit, outcome = 1e3 * NOISE_LIMIT * expected, PASSED if quiet else REDO
            found.append(
                Check("rest", name, "gyroscope's noise", text, np.nan, limit, "mrad/s", outcome, sentence)
            )
        return found

    def _accel_check(self) -> Check:
        name, rest = self.rows.name, self.accel
        if rest is None or not rest.known:
            seen = 0 if rest is None else rest.attitudes
            sentence = (
                f"At rest in {seen} attitudes; {LEAST_ATTITUDES} are needed. The previous values are kept."
            )
            std = np.nan if rest is None else float(rest.bias_std_m_s2.max())
            return Check("rest", name, "accelerometer", "-", std, BIAS_LIMIT_M_S2, "m/s2", KEPT, sentence)
        text = f"bias {numbers(rest.bias_m_s2, 2)}; scale {', '.join(f'{s:.3f}' for s in rest.scale)}"
        good = rest.after_m_s2 <= BIAS_LIMIT_M_S2
        sentence = (
            f"Gravity was off by up to {rest.before_m_s2:.2f} m/s2 and is now to {rest.after_m_s2:.3f}."
            if good
            else f"Gravity is still off by {rest.after_m_s2:.2f} m/s2 in one attitude: it was not at rest there."
        )
        std, outcome = float(rest.bias_std_m_s2.max()), PASSED if good else REDO
        return Check("rest", name, "accelerometer", text, std, BIAS_LIMIT_M_S2, "m/s2", outcome, sentence)

    def _mag_checks(self) -> list[Check]:
        name, fit = self.rows.name, self.mag
        if self.rows.mag is None:
            return []
        if fit is None:
            sentence = "Too few readings."
            return [Check("turn", name, "magnetometer", "-", np.nan, OFFSET_LIMIT_UT, "uT", REDO, sentence)]
        std = float(fit.offset_std_ut.max())
        text = f"offset {numbers(fit.offset_ut, 1)} uT, field {fit.norm_ut:.1f} uT"
        if fit.known:
            sentence = f"The norm scattered by {100 * fit.before:.0f} % and now by {100 * fit.after:.1f} %."
            return [Check("turn", name, "magnetometer", text, std, OFFSET_LIMIT_UT, "uT", PASSED, sentence)]
        if fit.after > NORM_LIMIT:
            sentence = (
                f"The norm still scatters by {100 * fit.after:.0f} %: iron is near. Turn it again elsewhere."
            )
        else:
            sentence = "It was not rotated through all directions. Rotate it about all three axes, or skip this step."
        outcome = REDO if fit.after > NORM_LIMIT else KEPT
        return [Check("turn", name, "magnetometer", text, std, OFFSET_LIMIT_UT, "uT", outcome, sentence)]
