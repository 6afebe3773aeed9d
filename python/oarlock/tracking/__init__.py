"""Tracking, smoothing and tracking many recordings: the track as arrays, series, places and a folder."""
