"""The exceptions of the package; the engine raises them too."""


class OarlockError(Exception):
    """Root of all errors that the package raises on purpose. The text says what is wrong, where, and what to do."""

    __module__ = "oarlock"


class ModelError(OarlockError, ValueError):
    """The model file is wrong; the text says where and what to do."""

    __module__ = "oarlock"


class DataError(OarlockError, ValueError):
    """The data or arguments are wrong; the text says where and what to do."""

    __module__ = "oarlock"


class DivergedError(OarlockError, RuntimeError):
    """The filter lost the track.

    Attributes:
        time_s: when, s.
    """

    __module__ = "oarlock"
    time_s: float
