"""The viewer: a track of any model as a moving figure with its curves, in a page that works offline.

    scene = oarlock.report.viewer.scene(track)
    Path("track.html").write_text(oarlock.report.viewer.page(scene, "My track"))

The player's source is in `viewer/` of the project; `player.js` and `player.css` here are built from it.
"""

from __future__ import annotations

from oarlock.report.viewer.curves import Curve, joint_curves
from oarlock.report.viewer.page import POLICY, embed, page, player_assets
from oarlock.report.viewer.scene import SHOWN_EVERY_S, scene

__all__ = ["POLICY", "SHOWN_EVERY_S", "Curve", "embed", "joint_curves", "page", "player_assets", "scene"]
