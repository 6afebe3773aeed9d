"""Calibrations from a pose, from single hinges, from chains of hinges, and of joint centres and the local field."""
