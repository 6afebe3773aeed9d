"""A second search that starts where the first ended, for `calibrate_motion`.

The first search meets a body with nominal mounts and lengths, and linearises its early readings about a wrong posture.
The filter takes these errors for information. The second search linearises about nearly right constants (Gauss-Newton).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from oarlock._core import Model
from oarlock.calibration.motion.constants import Constants
from oarlock.model.edit import document_of
from oarlock.model.rotation import quat_from_rotvec, quat_product, rotvec_from_quat
from oarlock.storage.toml import toml_text


def restarted(searched: Model, found: Constants) -> Model:
    """The searched model with parameters and mounts at what was found; its standard deviations stay."""
    document = document_of(searched)
    for name, value in found.parameters().items():
        document["parameters"][name]["default"] = value
    units = {s.name: s.mount for s in searched.describe().inertial_units}
    for unit in (s for s in document["sensor"] if s["kind"] == "imu"):
        unit["mount"].pop("rpy", None)
        unit["mount"]["rotation"] = (
            np.asarray(units[unit["name"]].rotation) @ found.mount_turn(unit["name"])
        ).tolist()
    return Model.from_toml(toml_text(document), searched.path, {})


def joined(first: Constants, second: Constants) -> Constants:
    """Both searches as one: the maximum a posteriori with the prior where the first search began.

    The second search had its prior at its own start, `first.moved` beyond the right one. With the information
    P^-1 = P0^-1 + L, a prior mean that is lower by d lowers the estimate by P P0^-1 d.
    """
    shift = second.covariance @ (first.moved / second.prior_std**2)
    further = replace(second, moved=second.moved - shift)
    moved = first.moved + further.moved
    for unit in first.units_with_mounts():
        rows = first.mount_rows(unit)
        one, other = (quat_from_rotvec(c.moved[rows]) for c in (first, further))
        moved[rows] = rotvec_from_quat(quat_product(one, other))
    return replace(second, start=first.start, moved=moved)
