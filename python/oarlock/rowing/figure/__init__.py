"""Shapes of rower, oars and boat for the viewer."""
