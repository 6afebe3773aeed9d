"""Finds strokes in tracks and recordings, offline and live, and makes the table with one row per stroke."""
