"""Calibrations of mounts, lengths and field from a pose, hinge axes, a hinge chain, or joint centres."""
