"""Self-calibration from ordinary movement: mounts and lengths from closed loops and known joints."""
