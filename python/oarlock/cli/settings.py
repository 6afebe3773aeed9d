"""Parses the filter settings of one run: `--config FILE` and `--set KEY=VALUE`."""

from __future__ import annotations

import tomllib
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock._core import Config
from oarlock.cli.model import posture
from oarlock.cli.options import assignments, names
from oarlock.cli.terminal import UsageError
from oarlock.storage.toml import TomlTable

if TYPE_CHECKING:
    from oarlock import Model

DEFAULTS = Config().to_dict()
MEANINGS = {
    "structure": "units integrate their readings, joints are readings (strapdown), or joint angles are states (tree)",
    "estimate": "additional states, comma-separated, or none: biases, base accelerations, mounts, lengths",
    "closures": "use the model's closures",
    "contacts": "use the model's contacts: the velocity of a foot that stands is zero",
    "process_noise": "white jerk (jerk), or Q of the paper's eq. 6 (paper)",
    "magnetometer": "reject disturbed readings (gated), use all (on) or none (off)",
    "initial_q.JOINT": "initial value of the first fit, rad or m; a coordinate of a ball joint is hip.rx",
    "gate": "reject outliers",
    "gate_patience_s": "accept a reading again after this time of rejection",
    "start_window_s": "window of samples that the initial fit uses",
    "merge_s": "time stamps closer than this are one instant",
    "sample_rate_hz": "rate of samples from sensors that do not tick together; 0: one for every instant",
    "inputs": "input joints whose encoders are taken as they are, comma-separated; the others are states",
    "stamp_std_s": "standard deviation of time stamps, by stream: {seat = 0.001}",
    "wait_s": "time that a live tracker waits for late readings",
    "belief_interval_s": "interval at which the full covariance is stored",
    "alpha": "spread of the sigma points, 0 to 1",
    "beta": "second-order weight, at least alpha^2",
    "kappa": "scaling, usually 0",
}
"""Settings without a flag of their own, with one line of help."""


def settings_help() -> str:
    """End of a help text: every setting with its default."""
    rows = [(f"{key}={_shown(key)}", about) for key, about in MEANINGS.items()]
    return "\n\n\b\nSettings (--set KEY=VALUE, with their defaults):\n" + "\n".join(
        f"  {name:<26} {about}" for name, about in rows
    )


def _shown(key: str) -> str:
    default = DEFAULTS.get(key, "VALUE")
    if isinstance(default, list):
        return ",".join(default)
    return str(default).lower() if isinstance(default, bool) else str(default)


def split(texts: Iterable[str] | None, parameters: Container[str]) -> tuple[dict[str, float], dict[str, Any]]:
    """Split texts of `--set` into model parameters and filter settings; a parameter takes precedence.

    Raises:
        UsageError: a text is not KEY=VALUE, a key comes twice, or a parameter is no number.
    """
    of_model: list[str] = []
    settings: dict[str, Any] = {}
    start: list[str] = []
    for text in texts or ():
        key, equals, value = (part.strip() for part in text.partition("="))
        if key.startswith("initial_q."):
            start.append(text.strip().removeprefix("initial_q."))
        elif equals and key in DEFAULTS and key not in parameters:
            if key in settings:
                raise UsageError(f"--set: {key} is given twice")
            settings[key] = names(value) if key in ("estimate", "inputs") else _value(value)
        else:
            of_model.append(text)
    if start:
        settings["initial_q"] = assignments(start, "--set initial_q.JOINT=VALUE:")
    return assignments(of_model, "--set"), settings


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return None if text == "none" else text


def settings_of_file(file: Path) -> dict[str, Any]:
    """Read settings from a TOML file: at top level, or in [provenance.config] of a run.toml."""
    top = TomlTable.read(file)
    if "provenance" in top.values:
        top = top.table("provenance").table("config")
    return {key: None if value == "none" else value for key, value in top.values.items()}


def configuration(body: Model, settings: Mapping[str, Any]) -> Config:
    """Return the checked configuration.

    Raises:
        UsageError: a key or a value is wrong.
    """
    chosen = dict(settings)
    if isinstance(start := chosen.get("initial_q"), Mapping):
        chosen["initial_q"] = posture(body.describe(), dict(start), "initial_q")
    try:
        return Config(**chosen)
    except (TypeError, ValueError) as error:
        raise UsageError(f"settings of the filter: {error}") from None
