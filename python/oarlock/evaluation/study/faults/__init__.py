"""Faults of recordings of any body, one file for each family."""
