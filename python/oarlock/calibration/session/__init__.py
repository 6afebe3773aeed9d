"""Calibration from a short guided session: sensors, mounts, encoders and field, with a check of each step."""
