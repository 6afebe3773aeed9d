"""Simulated recordings: joint trajectories, sensor signals along them, and simulated calibration sessions."""
