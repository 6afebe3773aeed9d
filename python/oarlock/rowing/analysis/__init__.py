"""Rowing technique for reports and Python users: definitions, values per stroke, means, targets."""
