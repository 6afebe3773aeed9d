"""The joints and places of the sculler whose errors the pages show."""

from __future__ import annotations

SHOULDER = ("shoulder_abduction", "shoulder_rotation", "shoulder_flexion")
ARM = (*SHOULDER, "elbow_flexion", "elbow_rotation")
ELEVEN = ("trunk", *(f"{side}_{joint}" for side in "rl" for joint in ARM))
"""Angles of trunk and arms."""
RADIAL = ("r_hand_abduction", "l_hand_abduction")
PALMAR = ("r_hand_flexion", "l_hand_flexion")
HANDS = RADIAL + PALMAR
PLACES = tuple(f"{side}_{place}" for place in ("shoulder", "elbow", "wrist") for side in "rl")
SETTLED_S = 2.0
"""The first seconds are not scored."""
