"""Strokes of a track: reversals, events, and the table with one row a stroke; offline and live."""
