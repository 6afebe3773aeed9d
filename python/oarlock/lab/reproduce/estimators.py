"""The estimators of Table 5 as settings of a study, with results of an independent implementation."""

from __future__ import annotations

from dataclasses import dataclass, field

ARM = ("shoulder_abduction", "shoulder_rotation", "shoulder_flexion", "elbow_flexion", "elbow_rotation")
ELEVEN = ("trunk", *(f"{side}_{joint}" for side in ("r", "l") for joint in ARM))
"""The angles of Table 5."""

_TREE: dict[str, object] = {"config.structure": "tree"}
# As in the paper: no gates, a known field; so n = 40.
_PLAIN: dict[str, object] = {
    **_TREE,
    "config.gate": False,
    "config.magnetometer": "on",
    "model.world.azimuth_fixed": True,
}
_SLOW = ["gyro_bias", "accel_bias", "surge"]

Bound = tuple[float, float]


@dataclass(frozen=True)
class PaperEstimator:
    """A row of the overview.

    Attributes:
        key: its name in tables.
        label: its name for people.
        states: n.
        values: settings.
        bounds: mean RMSE of the eleven angles (deg) and RMSE of the seat (mm) by condition.
        smoothed: whether the smoothed track is scored too.
    """

    key: str
    label: str
    states: int
    values: dict[str, object]
    bounds: dict[str, Bound] = field(default_factory=dict)
    smoothed: bool = False


def _plain(noise: str, closures: bool, slow: bool) -> dict[str, object]:
    return {
        **_PLAIN,
        "config.process_noise": noise,
        "config.closures": closures,
        "config.estimate": _SLOW if slow else [],
    }


def _bounds(*pairs: Bound) -> dict[str, Bound]:
    return dict(zip(("S-NB", "B-NB", "S-B", "B-B"), pairs, strict=True))


ESTIMATORS = (
    PaperEstimator(
        "eq6",
        "the paper's: eq. 6, no closure",
        40,
        _plain("paper", closures=False, slow=False),
        _bounds((0.27, 4.8), (1.61, 166.0), (0.31, 5.6), (1.63, 166.0)),
        smoothed=True,
    ),
    PaperEstimator("eq6_closure", "eq. 6, closure", 40, _plain("paper", closures=True, slow=False)),
    PaperEstimator(
        "eq6_states",
        "eq. 6, no closure, surge + bias",
        71,
        _plain("paper", closures=False, slow=True),
    ),
    PaperEstimator(
        "eq6_closure_states",
        "eq. 6, closure, surge + bias",
        71,
        _plain("paper", closures=True, slow=True),
    ),
    PaperEstimator(
        "jerk",
        "jerk, no closure",
        40,
        _plain("jerk", closures=False, slow=False),
        _bounds((0.020, 0.4), (0.048, 8.7), (0.32, 0.4), (0.33, 8.8)),
    ),
    PaperEstimator(
        "jerk_closure",
        "jerk, closure",
        40,
        _plain("jerk", closures=True, slow=False),
        _bounds((0.017, 0.3), (0.032, 7.2), (0.24, 0.5), (0.24, 7.2)),
    ),
    PaperEstimator(
        "jerk_states",
        "jerk, no closure, surge + bias",
        71,
        _plain("jerk", closures=False, slow=True),
    ),
    PaperEstimator(
        "jerk_closure_states",
        "jerk, closure, surge + bias",
        71,
        _plain("jerk", closures=True, slow=True),
        _bounds((0.020, 0.4), (0.020, 0.6), (0.020, 0.4), (0.020, 0.6)),
        smoothed=True,
    ),
    PaperEstimator("tree", "tree: jerk, closure, surge + bias, azimuth", 72, _TREE, smoothed=True),
    PaperEstimator("shipped", "as shipped: strapdown links", 161, {}, smoothed=True),
)
