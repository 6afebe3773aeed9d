"""The guided start of a live session: leads a person through a calibration session, step by step."""
