"""Rowing technique: what each number means, its value for each stroke, means, and targets."""
