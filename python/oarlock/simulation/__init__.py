"""Simulates recordings: joint trajectories, sensor signals along them, and guided calibration sessions."""
