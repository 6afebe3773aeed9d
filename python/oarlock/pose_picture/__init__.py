"""Draws a model in one posture: as text for a terminal, as SVG for a page. Side view and front view.

The side view looks at the body's right side with `forward` to the right; the front view looks at its
face, so the body's left is on the right. Both use one scale.
"""

from oarlock.pose_picture.skeleton import Skeleton, skeleton
from oarlock.pose_picture.svg import draw_svg
from oarlock.pose_picture.text import draw_text

__all__ = ["Skeleton", "draw_svg", "draw_text", "skeleton"]
