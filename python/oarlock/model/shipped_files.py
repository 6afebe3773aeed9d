"""Names and files of the models that ship with the package."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def model_folder() -> Path:
    """The folder that holds the shipped model files."""
    return Path(str(files("oarlock.model"))) / "shipped"


def model_names() -> tuple[str, ...]:
    """Names of the shipped models, sorted."""
    return tuple(sorted(path.stem for path in model_folder().glob("*.toml")))


def model_path(name: str) -> Path:
    """The file of a shipped model.

    Raises:
        KeyError: no shipped model has this name.
    """
    if name not in model_names():
        raise KeyError(name)
    return model_folder() / f"{name}.toml"
