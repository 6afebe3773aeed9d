"""Names of the filters of `--filter`, apart from the filters, so that help needs to import none."""

from typing import Final

TREE_FILTERS: Final = ("ukf", "ekf", "factorised")
"""The engine's own filters."""
LIMB_FILTER: Final = "limbs"
ORIENTATION_FILTERS: Final = ("vqf", "madgwick", "quaternion_ekf", "quest_ekf", "vector_kf")
"""Filters on a single unit."""
