"""Reads a C3D file in a process of its own, which a damaged file may end: `python c3d_child.py FILE`.

Stands alone, so that it starts quickly. Writes the arrays `points` (3, N, T), `residuals` (N, T), `rate_hz`,
`first_frame`, `unit` and `labels` as .npz to standard output; what the library complains of, to standard error, and
then ends with 1.
"""

import io
import sys
from typing import Any

import numpy as np


def main(file: str) -> int:
    """Read one file; the exit status."""
    import ezc3d

    try:
        content = ezc3d.c3d(file)
        arrays = _arrays(content)
    except Exception as error:  # ezc3d raises whatever its C++ side throws
        print(error, file=sys.stderr)
        return 1
    held = io.BytesIO()
    np.savez(held, **arrays)
    sys.stdout.buffer.write(held.getvalue())
    return 0


def _arrays(content: Any) -> dict[str, Any]:
    point, header = content["parameters"]["POINT"], content["header"]["points"]
    units = point["UNITS"]["value"] if "UNITS" in point else []
    return {
        "points": np.asarray(content["data"]["points"], dtype=np.float64)[:3],
        "residuals": np.asarray(content["data"]["meta_points"]["residuals"], dtype=np.float64)[0],
        "rate_hz": np.float64(header["frame_rate"]),
        "first_frame": np.int64(header["first_frame"]),
        "unit": np.array(str(units[0]) if len(units) else ""),
        "labels": np.array(_labels(point), dtype=np.str_),
    }


def _labels(point: Any) -> list[str]:
    """All labels: a C3D parameter holds 255, so large sets go on in LABELS2, LABELS3, ..."""
    found: list[str] = []
    for number in range(1, 100):
        key = "LABELS" if number == 1 else f"LABELS{number}"
        if key not in point:
            break
        found += [str(label).strip() for label in point[key]["value"]]
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
