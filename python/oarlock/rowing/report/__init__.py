"""The rower's sections of a report: strokes, technique, two pieces side by side."""
