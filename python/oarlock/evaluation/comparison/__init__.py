"""Comparison with estimators of the literature: filters of whole trees, of limbs, and of single units."""
