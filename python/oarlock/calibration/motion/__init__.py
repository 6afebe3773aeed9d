"""Calibration from ordinary movement: mounts, lengths, sensor positions and encoder zeros, from closed loops."""
