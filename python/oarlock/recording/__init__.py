"""Recordings and calibrations: streams of readings, plausibility checks, corrections, and the files of both."""
