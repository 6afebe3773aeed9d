"""`UnclearError`: a file that can be read in several ways. `oarlock import` asks which; a script gets the choices."""

from __future__ import annotations

from collections.abc import Mapping

from oarlock.storage.errors import DataError


class UnclearError(DataError):
    """Several readings of a file are possible.

    Args:
        message: what is not clear, and how to say it.
        option: the keyword of the reader that decides.
        choices: value of the option -> what follows from it; empty if any number is possible.
    """

    def __init__(self, message: str, option: str, choices: Mapping[str, str]) -> None:
        super().__init__(message)
        self.option = option
        self.choices = dict(choices)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return type(self), (str(self), self.option, self.choices)
