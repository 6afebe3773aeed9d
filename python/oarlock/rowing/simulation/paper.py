"""Printed results of the paper of the sculler, for comparison with ours.

Source: E. Ruffaldi, L. Peppoloni, A. Filippeschi, "Sensor fusion for complex articulated body tracking
applied in rowing", Journal of Sports Engineering and Technology. Tables 5 and 6, section 5.

Table 5 names the left arm's joints after their frames: its q11 to q15 are the joints q10 to q14 of
Table 2. The names here are those of the model `sculler`.
"""

from __future__ import annotations

from typing import NamedTuple

CITATION = "Ruffaldi, Peppoloni, Filippeschi, J. Sports Engineering and Technology, Table 5"

STEPS_PER_S = 116.0
"""Filter steps per second on an Intel Core i7 M620 at 2.66 GHz; section 5."""

STATES = 37
MEASUREMENTS = 58
FRAMES = 25
"""Sizes that section 5 puts into its formula (19); see `SLIPS` on the 37."""

CONDITIONS = ("S-NB", "B-NB", "S-B", "B-B")
"""Boat still or moving (S, B), sensors without or with constant biases (NB, B)."""


class PrintedError(NamedTuple):
    """Error of one joint: RMSE in `unit` (deg or mm), correlation (None where the table has a dash)."""

    rmse: float
    unit: str
    correlation: float | None


# One row a joint: RMSE for each condition (deg; the seat mm), then the correlation for each condition.
_TABLE_5: dict[str, tuple[tuple[float, ...], tuple[float, ...] | None]] = {
    "seat": ((16.0, 18.0, 20.0, 21.0), (0.997, 0.996, 0.996, 0.996)),
    "trunk": ((24.41, 24.31, 26.30, 26.41), (0.423, 0.425, 0.344, 0.330)),
    "r_shoulder_abduction": ((3.32, 3.11, 3.39, 3.22), (0.972, 0.974, 0.968, 0.971)),
    "r_shoulder_rotation": ((4.88, 5.17, 5.33, 4.69), (0.996, 0.994, 0.994, 0.993)),
    "r_shoulder_flexion": ((9.46, 9.57, 7.93, 8.79), (0.998, 0.999, 0.997, 0.999)),
    "r_elbow_flexion": ((10.78, 10.76, 10.77, 11.01), (0.983, 0.982, 0.980, 0.981)),
    "r_elbow_rotation": ((0.0, 0.0, 0.0, 0.0), None),
    "l_shoulder_abduction": ((9.21, 9.49, 9.12, 8.99), (0.982, 0.974, 0.979, 0.978)),
    "l_shoulder_rotation": ((6.03, 6.14, 5.71, 5.47), (0.993, 0.993, 0.993, 0.993)),
    "l_shoulder_flexion": ((16.78, 17.15, 16.70, 16.76), (0.990, 0.986, 0.994, 0.989)),
    "l_elbow_flexion": ((7.49, 8.85, 6.40, 7.69), (0.990, 0.987, 0.991, 0.989)),
    "l_elbow_rotation": ((0.0, 0.0, 0.0, 0.0), None),
}


def mean_rmse_deg(condition: str) -> float:
    """Mean over the nine angles of Table 5 whose printed error is not zero, deg.

    Raises:
        ValueError: the table has no such condition.
    """
    errors = [joint.rmse for joint in table_5(condition).values() if joint.unit == "deg" and joint.rmse > 0.0]
    return sum(errors) / len(errors)


def table_5(condition: str) -> dict[str, PrintedError]:
    """Printed errors by joint for one condition; deg for hinges, mm for the seat.

    Raises:
        ValueError: the table has no such condition.
    """
    if condition not in CONDITIONS:
        raise ValueError(f"Table 5 has no condition '{condition}'; it has {', '.join(CONDITIONS)}")
    column = CONDITIONS.index(condition)
    return {
        joint: PrintedError(
            rmse=rmse[column],
            unit="mm" if joint == "seat" else "deg",
            correlation=None if correlation is None else correlation[column],
        )
        for joint, (rmse, correlation) in _TABLE_5.items()
    }


class PrintedPosition(NamedTuple):
    """Error of one position: 3D RMSE in m, and correlation."""

    rmse_m: float
    correlation: float


# Table 6: real tests, two trials of 40 s at 100 Hz, against optical markers.
_TABLE_6 = {
    "r_shoulder": PrintedPosition(0.078, 0.3965),
    "l_shoulder": PrintedPosition(0.081, 0.4814),
    "r_elbow": PrintedPosition(0.158, 0.8299),
    "l_elbow": PrintedPosition(0.153, 0.9081),
    "r_wrist": PrintedPosition(0.034, 0.9913),
    "l_wrist": PrintedPosition(0.054, 0.9864),
}


def table_6() -> dict[str, PrintedPosition]:
    """Printed errors of shoulders, elbows and wrists, in the paper's order, by the frames' names here."""
    return dict(_TABLE_6)


SLIPS: dict[str, str] = {
    "states": "The paper gives n = 37 = 3 x 11 + 4, its eq. 2 lists twelve joints with velocity and acceleration: "
    "n = 3 x 12 + 4 = 40 and 81 sigma points, not 75. With 37 the seat would be missing, which eq. 10 measures.",
    "measurements": "58 = 5 x 9 inertial + seat + 12 closure rows. The four oar encoders of the text's 50 signals are "
    "inputs of the closures.",
    "left_arm": "Table 5 names the left arm's joints after their frames: its q11 to q15 are q10 to q14 of Table 2.",
    "zeros": "Table 5 prints an error of 0 and no correlation for the two elbow rotations (q7, q15): a joint that was "
    "not moved, or not estimated. Ours move and are estimated. The mean over the paper's other nine angles "
    "is printed beside our mean over eleven.",
    "no_closure": 'Table 5 was made "in which the oar handle pose was not available": compare it with the rows without '
    "closure.",
    "eq6": "Eq. 6 prints a process noise without a scale and of rank one. Here it has the density 11.2 rad/s2 per "
    "sqrt(s) (m/s2 for the seat), as the white jerk beside it.",
    "table4": 'Table 4 heads gyroscopes "rad/s2 1e-3"; the figures are rad/s x 1e-3, and so they are used.',
    "axes": "Figure 4's caption lets x point to the feet, Figure 1 lets Z. Figure 1 is followed: "
    "X to the rower's left, Y up, Z to the feet.",
    "elbow": "Figure 3 draws the elbow's flexion negative. With Table 2 read as here it is positive.",
    "rates": "The simulated experiment ran at 125 Hz, the real one at 100 Hz; so do these.",
    "boat": "The boat model [4] is not printed. Here the hull surges by the momentum balance of hull and rower "
    "(oarlock.rowing.Boat).",
    "biases": "Ten times the biases that the authors measured at rest: 0.01 rad/s and 0.01 m/s2 on every axis.",
}
"""Where the paper's text leaves a gap or slips, and how it is read here. CONVENTIONS.md lists all of them."""
