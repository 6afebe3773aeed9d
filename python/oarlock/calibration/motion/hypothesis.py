"""Noise hypotheses of `calibrate_motion` ("rigid", "soft"): size and time correlation of deviations from the model."""

from __future__ import annotations

from dataclasses import dataclass

MOUNT_STD_RAD = 0.08
"""How far a unit that was strapped on by eye is turned about each axis: 4.6 deg."""
PLACE_STD_M = 0.010
"""How far it sits from where the model has it, along each axis."""
HINGE_ZERO_STD_RAD = 0.0087
"""Zero of an encoder of a hinge, half a degree."""
SLIDE_ZERO_STD_M = 0.005
"""Zero of an encoder of a slide."""


@dataclass(frozen=True)
class Hypothesis:
    """How readings differ from those of the model's rigid body.

    Args:
        name: for the report.
        gyro_rad_s: standard deviation that soft tissue adds to a gyroscope, each axis.
        accel_m_s2: that it adds to an accelerometer.
        mag_ut: that it adds to a magnetometer, with iron.
        loop_m: that closures and their points miss each other by.
        loop_axis: that their axes do, direction cosines.
        samples_per_error: how many samples in a row tell the same error; they count as one. All of a sample's weight
            is divided by it, which is the same as priors that weigh so many times more.
        displacement: variance of a constant displacement of all units on their links, as a multiple of the prior
            variance of their mounts and positions.
        rocks: the accelerated root also sways, heaves, yaws, pitches and rolls; else it is pushed in all directions.
    """

    name: str
    gyro_rad_s: float = 0.0
    accel_m_s2: float = 0.0
    mag_ut: float = 0.0
    loop_m: float = 0.0
    loop_axis: float = 0.0
    samples_per_error: float = 1.0
    displacement: float = 0.0
    rocks: bool = False


RIGID = Hypothesis("rigid", samples_per_error=5.0, rocks=True)
"""The model is right, but for constants and for a root that rocks. Early readings meet a wrong body, and a filter takes
their bends for information: at full weight widths go astray by centimetres."""

SOFT = Hypothesis("soft", 0.2, 1.0, 3.0, 0.008, 0.06, samples_per_error=100.0, displacement=2.0)
"""Straps on skin: a unit lags by a tenth of what its limb turns at 2 rad/s, rings by a tenth of g, a hand slips by
millimetres; and it does so alike for most of a second (100 samples at 125 Hz). In the mean over a movement skin carries
a unit farther from the bone than a strap put on by eye, so at most a third of what the readings tell of mounts is kept.
It does not carry joints, so lengths follow the readings."""
