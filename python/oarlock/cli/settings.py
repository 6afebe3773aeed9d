"""Parses the filter settings of one run: `--config FILE` and `--set KEY=VALUE`."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock._core import Config
from oarlock.cli.model import posture
from oarlock.cli.terminal import UsageError
from oarlock.cli.verbs import assignments, names
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable
from oarlock.tracking.settings import meanings

if TYPE_CHECKING:
    from oarlock import Model

DEFAULTS = Config().to_dict()
OWN_FLAGS = {"filter", "output_rate_hz"}
MEANINGS = {
    "initial_q.JOINT" if name == "initial_q" else name: meaning
    for name, meaning in meanings().items()
    if name not in OWN_FLAGS
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


def split(
    texts: Iterable[str] | None, parameters: Collection[str]
) -> tuple[dict[str, float], dict[str, Any]]:
    """Split texts of `--set` into model parameters and filter settings; a parameter takes precedence.

    Raises:
        UsageError: a text is not KEY=VALUE, a key is unknown or comes twice, or a parameter is no number.
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
        elif equals and key not in parameters:
            raise UsageError(
                f"--set {key}: is neither a parameter of the model nor a setting. "
                f"{did_you_mean(key, [*parameters, *DEFAULTS])}"
            )
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
