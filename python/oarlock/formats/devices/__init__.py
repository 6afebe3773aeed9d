"""Readers of the files of makers of inertial units, one file a format."""
