"""Writes a track for other software: tables with units, and an OpenSim model with its motion."""
