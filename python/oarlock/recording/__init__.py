"""What was measured, and the calibration of one wearing that corrects it: streams, checks of plausibility, folders."""
