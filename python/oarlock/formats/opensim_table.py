"""Writes OpenSim's tables over time, `.mot` and `.sto`: a header, then columns separated by tabs. Used by exports."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock.storage.arrays import Floats


def table_text(
    title: str,
    labels: Sequence[str],
    time_s: Floats,
    values: Floats,
    in_degrees: bool,
    remarks: Sequence[str] = (),
) -> str:
    """The file's text, every number with all its digits and `nan` where there is none.

    Args:
        title: first line; `Coordinates` of a motion, as OpenSim writes it.
        labels: names of the columns, plain ASCII.
        time_s: (T,) s.
        values: (T, n), in m and in degrees or rad, depending on `in_degrees`.
        in_degrees: unit of angles in the header, which OpenSim uses.
        remarks: sentences for people. Equals signs and other scripts are replaced, because readers mistake them for
            keys.
    """
    unit = "degrees" if in_degrees else "radians"
    head = [
        title,
        "version=1",
        f"nRows={len(time_s)}",
        f"nColumns={len(labels) + 1}",
        f"inDegrees={'yes' if in_degrees else 'no'}",
        "",
        "Units are S.I. units (second, meters, Newtons, ...)",
        f"Angles are in {unit}.",
        *(_plain(remark) for remark in remarks),
        "",
        "endheader",
        "\t".join(["time", *labels]),
    ]
    rows = zip(time_s.tolist(), values.tolist(), strict=True)
    return "\n".join([*head, *("\t".join(map(repr, (time, *row))) for time, row in rows)]) + "\n"


def quaternion_text(labels: Sequence[str], time_s: Floats, quat_wxyz: Floats) -> str:
    """A table of orientations for OpenSense: cells `w,x,y,z`, rows with a NaN left out.

    Args:
        labels: names of the columns, `BODY_imu` for OpenSense.
        time_s: (T,) s.
        quat_wxyz: (T, n, 4) ground from body.
    """
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    head = [
        f"DataRate={1.0 / step_s:.6f}",
        "DataType=Quaternion",
        "version=3",
        "OpenSimVersion=4.6",
        "endheader",
    ]
    known = np.isfinite(quat_wxyz).all(axis=(1, 2))
    rows = zip(time_s[known].tolist(), quat_wxyz[known].tolist(), strict=True)
    lines = ("\t".join([repr(time), *(",".join(map(repr, quat)) for quat in row)]) for time, row in rows)
    return "\n".join([*head, "\t".join(["time", *labels]), *lines]) + "\n"


def _plain(remark: str) -> str:
    line = " ".join(remark.split()).replace("=", " is ")
    return line.encode("ascii", "replace").decode("ascii")
