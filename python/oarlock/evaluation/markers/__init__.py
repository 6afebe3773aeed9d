"""Optical markers as a reference: trajectories, gaps, smoothing, inverse kinematics, body dimensions."""
