"""From a short guided session to a calibration: what each step found, how sure, and what to do again."""
