"""Sculling on the water: a second simulator, in which nothing is as modelled."""
