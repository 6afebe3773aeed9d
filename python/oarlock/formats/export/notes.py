"""Notes about missing and uncertain data of an export."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from oarlock.formats.export.opensim_body import SEQUENCE
from oarlock.model.angle_sequence import near_singular
from oarlock.model.coordinates import parts
from oarlock.model.rotation import quat_from_rotvec
from oarlock.storage.arrays import Bools, Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.tracking.track import Track


def reading_notes(track: Track) -> tuple[str, ...]:
    """Notes on joints without readings, with gaps, or not observed."""
    return tuple(
        sentence
        for part in parts(track.coordinate_names)
        for sentence in _on_part(part.name, track, list(part.columns))
    )


def empty_notes(track: Track, files: Sequence[str]) -> tuple[str, ...]:
    """A note on the columns that tables leave out because they have no number."""
    tables = [name for name in files if name in ("coordinates.csv", "coordinates.parquet")]
    rates = {"velocity or acceleration": track.qd, "standard deviation": track.q_std}
    told: dict[str, Bools] = {
        what: np.asarray(np.isfinite(values).any(axis=0)) for what, values in rates.items()
    }
    lacks = {
        what: [name for name, known in zip(track.coordinate_names, columns, strict=True) if not known]
        for what, columns in told.items()
    }
    return tuple(
        f"{' and '.join(tables)} leave out columns without a number: there is no {what} of {', '.join(names)}."
        for what, names in lacks.items()
        if tables and names
    )


def model_notes(model: Model) -> tuple[str, ...]:
    """Notes on parts of a model that the OpenSim model does not contain."""
    closures = model.closure_names
    if not closures:
        return ()
    return (
        f"closures left out of the OpenSim model: {', '.join(closures)}. The track satisfies them within its bands; a "
        "constraint would move joints to remove the residual.",
    )


def pole_notes(track: Track) -> tuple[str, ...]:
    """Notes on rotations whose three angles are near a singularity in OpenSim's order."""
    rotations = [part for part in parts(track.coordinate_names) if part.kind == "rotation"]
    return tuple(
        sentence for part in rotations for sentence in _on_pole(part.joint, track.q[:, list(part.columns)])
    )


def left_out_notes(file: str, what: str, names: Sequence[str], there: Sequence[bool]) -> tuple[str, ...]:
    """Notes on columns that are missing in the track."""
    if all(there):
        return ()
    if not any(there):
        return (f"{file} is not written: the track has no {what}.",)
    left = [name for name, known in zip(names, there, strict=True) if not known]
    return (f"{file} leaves out {', '.join(left)}: the track has no {what} for them.",)


def _on_part(name: str, track: Track, columns: list[int]) -> Iterator[str]:
    missing: Bools = np.asarray(np.isnan(track.q[:, columns]).any(axis=1))
    if missing.all():
        yield (
            f"{name}: no stream measured it. It is 0 in coordinates.mot and in the positions of frames, and has "
            "no number in other files."
        )
        return
    if missing.any():
        yield (
            f"{name}: no reading in {_share(missing, track)}. There are no numbers there, nor for frames that it moves."
        )
    unseen: Bools = ~track.observed[:, columns].all(axis=1) & ~missing
    if unseen.any():
        yield (
            f"{name}: not observed in {_share(unseen, track)}. Its value there follows from "
            "the prior; its standard deviation shows how uncertain it is."
        )


def _on_pole(name: str, rotvec_rad: Floats) -> Iterator[str]:
    near = near_singular(quat_from_rotvec(rotvec_rad), SEQUENCE)
    if near.any():
        yield (
            f"{name}: within 15 deg of the pole of the angles {SEQUENCE} in {near.sum()} of {len(near)} rows. The "
            "posture is exact there, but single angles, their rates and their standard deviations are large."
        )


def _share(rows: Bools, track: Track) -> str:
    times = track.time_s[rows]
    return f"{rows.sum()} of {len(rows)} rows, the first at {times[0]:.3f} s, the last at {times[-1]:.3f} s"
