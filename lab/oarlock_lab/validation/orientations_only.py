"""A body tracked from the orientations of its units alone, beside OpenSim's inverse kinematics on the same quaternions.

Used by the comparison on the robot's links: the raw signals go through VQF and are then dropped.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import oarlock
from oarlock import Recording
from oarlock.formats.datasets.openaxes import LINKS
from oarlock.recording import OrientationStream

from . import chains, ours
from .chains import Chain, Link
from .estimate import OrientationEstimate, Outcome, attempt

MODEL = Path(__file__).parent / "models" / "openaxes_orientations.toml"
CHAIN: Chain = (Link("radius", "xyz"), Link("carpus", "x"))
LABEL = "Oarlock, orientations only"


def estimates(on_units: OrientationEstimate, on_links: OrientationEstimate) -> Iterator[Outcome]:
    """Oarlock and other software on the same orientations: of the units, and of the links that carry them."""
    yield replace(on_links, name=f"{on_links.name}, each link by itself")
    yield from attempt([LABEL], lambda: _tracked(on_units))
    for outcome, _ in chains.on_chain(on_links, CHAIN):
        yield outcome


def _tracked(on_units: OrientationEstimate) -> Iterator[OrientationEstimate]:
    streams = [OrientationStream(link, on_units.time_s, on_units.quats[link]) for link in LINKS]
    track = oarlock.track(oarlock.load_model(str(MODEL)), Recording(streams))
    for label, result in ((LABEL, track), (f"{LABEL}, smoothed", oarlock.smooth(track))):
        yield ours.estimate_of(label, result, LINKS, online=result is track)
