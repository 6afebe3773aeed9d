"""Estimators of the literature on the same recording: whole trees, limbs, single units with inverse kinematics."""
