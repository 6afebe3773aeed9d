"""What other devices measured beside the motion: their strokes on the track's clock; pace, heart rate and force."""
