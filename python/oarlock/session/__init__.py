"""From a short guided session to a calibration: what each step found, how sure, and what to do again."""

from oarlock.session.plan import SessionPlan, SessionStep, default_plan, load_session_plan
from oarlock.session.search import calibrate_session

__all__ = ["SessionPlan", "SessionStep", "calibrate_session", "default_plan", "load_session_plan"]
