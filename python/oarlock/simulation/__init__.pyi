"""Public names of `oarlock.simulation` and the modules that define them."""

from .motion import Motion
from .session import SessionErrors, SessionTrial, simulate_session

__all__ = [
    "Motion",
    "SessionErrors",
    "SessionTrial",
    "simulate_session",
]
