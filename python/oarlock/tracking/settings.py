"""Settings of the filter (`Settings`): their names, types and meanings, for `track`, `Config` and the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, TypedDict, get_args, get_type_hints


class Settings(TypedDict, total=False):
    """Keywords of `track` and `Config`. Every one has a default: `oarlock.Config()` shows them."""

    structure: Annotated[
        Literal["strapdown", "tree"] | None,
        "units integrate their readings, joints are readings (strapdown), or joint angles are states (tree)",
    ]
    estimate: Annotated[
        Sequence[str],
        "additional states, comma-separated, or none: biases, base accelerations, mounts, lengths",
    ]
    closures: Annotated[bool, "use the model's closures"]
    contacts: Annotated[bool, "use the model's contacts: the velocity of a foot that stands is zero"]
    process_noise: Annotated[Literal["jerk", "paper"], "white jerk (jerk), or Q of the paper's eq. 6 (paper)"]
    magnetometer: Annotated[
        Literal["gated", "on", "off"], "reject disturbed readings (gated), use all (on) or none (off)"
    ]
    filter: Annotated[
        Literal["ukf", "ekf", "factorised"],
        "how a tree's update is computed: sigma points, linearised, or factorised",
    ]
    initial_q: Annotated[
        Sequence[float] | None,
        "initial value of the first fit, rad or m; a coordinate of a ball joint is hip.rx",
    ]
    gate: Annotated[bool, "reject outliers"]
    gate_patience_s: Annotated[float, "accept a reading again after this time of rejection"]
    start_window_s: Annotated[float, "window of samples that the initial fit uses"]
    merge_s: Annotated[float, "time stamps closer than this are one instant"]
    sample_rate_hz: Annotated[
        float | None, "rate of samples from sensors that do not tick together; 0: one for every instant"
    ]
    output_rate_hz: Annotated[float | None, "rate of the rows of a track; 0: a row for every sample"]
    inputs: Annotated[
        Sequence[str] | None,
        "input joints whose encoders are taken as they are, comma-separated; the others are states",
    ]
    stamp_std_s: Annotated[
        Mapping[str, float] | None, "standard deviation of time stamps, by stream: {seat = 0.001}"
    ]
    wait_s: Annotated[float, "time that a live tracker waits for late readings"]
    belief_interval_s: Annotated[float, "interval at which the full covariance is stored"]
    alpha: Annotated[float, "spread of the sigma points, 0 to 1"]
    beta: Annotated[float, "second-order weight, at least alpha^2"]
    kappa: Annotated[float, "scaling, usually 0"]


def meanings() -> dict[str, str]:
    """What each setting means, in one line."""
    return {name: get_args(hint)[1] for name, hint in get_type_hints(Settings, include_extras=True).items()}
