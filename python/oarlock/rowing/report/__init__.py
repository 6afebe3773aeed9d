"""The sections of a rower's report: strokes, technique, two pieces compared. Used by `oarlock report`."""
