"""The exceptions of the package; the engine raises them too."""


class OarlockError(Exception):
    """Any error of the package; its text says what is wrong, where, and what to do."""

    __module__ = "oarlock"


class ModelError(OarlockError, ValueError):
    """The model file is wrong."""

    __module__ = "oarlock"


class DataError(OarlockError, ValueError):
    """The data or arguments are wrong."""

    __module__ = "oarlock"


class DivergedError(OarlockError, RuntimeError):
    """The filter diverged at `time_s`, s."""

    __module__ = "oarlock"
    time_s: float
