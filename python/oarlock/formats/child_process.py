"""Runs readers of MATLAB, C3D, HDF5 and MCAP files in a child process: a crash of the library becomes a DataError."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular

_CHILD = Path(__file__).with_name("reader_child.py")
_NAMES = {"c3d": "C3D", "c3d_analogue": "C3D", "hdf5": "HDF5", "mat": "MATLAB", "mcap": "MCAP"}


def arrays_of(
    kind: Literal["c3d", "c3d_analogue", "hdf5", "mat", "mcap"], file: Path
) -> dict[str, NDArray[Any]]:
    """The arrays that `reader_child` finds in a file, by name.

    Raises:
        DataError: The file cannot be read, or its library refuses it or crashes.
    """
    try:
        open_regular(file).close()
    except DataError:
        raise
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    # -P: do not import from the folder of the script. The child's address space is limited, and each thread of
    # BLAS would use some.
    done = subprocess.run(
        [sys.executable, "-P", str(_CHILD), kind, str(file)],
        capture_output=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines() if done.returncode == 1 else []
        why = said[-1] if said else f"its reader {_end(done.returncode)}"
        raise DataError(f"{file}: is not a {_NAMES[kind]} file, or is damaged ({why})")
    with np.load(io.BytesIO(done.stdout)) as arrays:
        return dict(arrays)


def _end(status: int) -> str:
    return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
