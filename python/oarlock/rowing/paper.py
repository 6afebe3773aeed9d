"""Printed results of the paper that the sculler follows, for setting our own beside them.

Source: E. Ruffaldi, L. Peppoloni, A. Filippeschi, "Sensor fusion for complex articulated body tracking
applied in rowing", Journal of Sports Engineering and Technology. Table 5 and section 5.

Table 5 names the left arm's joints after their frames: its q11 to q15 are the joints q10 to q14 of
Table 2. The names here are those of the model `sculler`.
"""

from __future__ import annotations

from typing import NamedTuple

CITATION = "Ruffaldi, Peppoloni, Filippeschi, J. Sports Engineering and Technology, Table 5"

STEPS_PER_S = 116.0
"""Filter steps per second on an Intel Core i7 M620 at 2.66 GHz; section 5."""

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
