"""Libraries that only some users have: public names and functions that need one say which extra installs it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import lazy_loader

FULL = "full"
"""The extra with the libraries that searches, simulators, studies and seasons import."""
_OF_FULL = ("scipy", "pyarrow")


def optional(module: str, extra: str, asked: str) -> Any:
    """A module that only some users have.

    Raises:
        DataError: it is not installed. The text has the command that installs it.
    """
    from oarlock.storage.errors import DataError

    try:
        return importlib.import_module(module)
    except ImportError:
        raise DataError(_needed(asked, module, extra)) from None


def missing(error: ModuleNotFoundError, asked: str) -> str | None:
    """What to install for `asked`, a command or a name; None if the module belongs to no extra of Oarlock."""
    package = (error.name or "").partition(".")[0]
    return _needed(asked, package, FULL) if package in _OF_FULL else None


def public_names(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a room, whose names load their modules when they are first used."""
    load, names, all_names = lazy_loader.attach_stub(package, file)

    def __getattr__(name: str) -> Any:
        try:
            return load(name)
        except ModuleNotFoundError as error:
            if text := missing(error, f"{package}.{name}"):
                raise ModuleNotFoundError(text, name=error.name) from None
            raise

    return __getattr__, names, all_names


def _needed(asked: str, module: str, extra: str) -> str:
    return f"{asked} needs {module.partition('.')[0]}: pip install 'oarlock[{extra}]'"
