"""Evaluates tracks: scores against ground truth and markers, comparisons, Monte-Carlo studies, sensor faults."""
