"""Calibration of clocks: offset and drift of each stream's clock, from movement that all sensors measure."""
