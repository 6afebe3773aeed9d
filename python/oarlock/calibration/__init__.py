"""Searches that produce a `Calibration`: from a static pose or single joints, a guided session, clocks, or movement."""
