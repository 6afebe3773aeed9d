"""Public names of `oarlock.simulation` and the modules that define them."""

from .session import SessionErrors, SessionTrial, simulate_session

__all__ = [
    "SessionErrors",
    "SessionTrial",
    "simulate_session",
]
