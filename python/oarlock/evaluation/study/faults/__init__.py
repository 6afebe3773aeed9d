"""Sensor faults that a study can simulate, one module for each family."""
