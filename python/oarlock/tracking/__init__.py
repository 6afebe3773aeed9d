"""Tracks recordings and smooths tracks. Contains `track`, `smooth`, `track_many`, the class `Track` and its files."""
