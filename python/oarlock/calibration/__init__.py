"""The searches that find a calibration: from static poses, a guided session, clocks, or ordinary movement."""
