"""Files of the example recordings that ship with the package."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def _folders() -> tuple[Path, Path]:
    package = Path(str(files("oarlock")))
    # of a working copy, whose build leaves copies beside the modules that may be older; and of a wheel
    return package.parent.parent / "examples", package / "data"


def path(name: str) -> Path:
    """Folder of the example `name`, such as `pendulum`.

    Raises:
        FileNotFoundError: neither the package nor a working copy around it holds the example.
    """
    for folder in _folders():
        if (folder / name).is_dir():
            return folder / name
    looked = " and ".join(str(folder) for folder in _folders())
    raise FileNotFoundError(
        f"the example '{name}' is not installed: looked in {looked}. "
        "It comes with a clone of the repository; run from there."
    )
