"""Diagnosis of sensor faults: each fault is a hypothesis that is tested on one second of a recording."""
