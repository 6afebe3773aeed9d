"""Data that lies beside the checkout and not in it."""

import os
from pathlib import Path

import pytest


def local_folder(name: str) -> Path:
    """A folder of `OARLOCK_DATA`, such as `data/broad`; skips the test where it is not."""
    root = os.environ.get("OARLOCK_DATA", "")
    folder = Path(root, name)
    if not root or not folder.is_dir():
        pytest.skip(
            f"NOT RUN: {name} is absent. Set OARLOCK_DATA to the folder that holds it (it is {root!r})"
        )
    return folder
