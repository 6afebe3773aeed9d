"""Runs readers of MATLAB, C3D, HDF5 and MCAP files in a child process: a crash of the library becomes a DataError.

The child limits itself where the system can (`reader_child`). The parent also watches its memory and its time, which
works on every system.
"""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.reader_child import limits_of
from oarlock.storage.errors import DataError
from oarlock.storage.memory_limit import memory_of
from oarlock.storage.regular_file import open_regular, shown_bytes

_CHILD = Path(__file__).with_name("reader_child.py")
_WATCH_S = 0.2
_PATIENCE = 5
"""The child may wait for the processor this many times as long as it may use it."""
_NAMES = {"c3d": "C3D", "c3d_analogue": "C3D", "hdf5": "HDF5", "mat": "MATLAB", "mcap": "MCAP"}


def arrays_of(
    kind: Literal["c3d", "c3d_analogue", "hdf5", "mat", "mcap"], file: Path
) -> dict[str, NDArray[Any]]:
    """The arrays that `reader_child` finds in a file, by name.

    Raises:
        DataError: The file cannot be read, or its library refuses it or crashes.
    """
    open_regular(file).close()
    most_bytes, most_s = limits_of(file)
    # -P: do not import from the folder of the script. The child's address space is limited, and each thread of
    # BLAS would use some.
    with subprocess.Popen(
        [sys.executable, "-P", str(_CHILD), kind, str(file)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    ) as child:
        try:
            output, errors, why = _watched(child, most_bytes, _PATIENCE * most_s)
        except BaseException:
            child.kill()
            raise
    if child.returncode != 0:
        said = errors.decode(errors="replace").strip().splitlines() if child.returncode == 1 else []
        why = why or (said[-1] if said else f"its reader {_end(child.returncode)}")
        raise DataError(f"{file}: is not a {_NAMES[kind]} file, or is damaged ({why})")
    with np.load(io.BytesIO(output)) as arrays:
        return dict(arrays)


def _watched(child: subprocess.Popen[bytes], most_bytes: int, most_s: float) -> tuple[bytes, bytes, str]:
    """What the child writes, and why it was ended; "" if it was not."""
    end = time.monotonic() + most_s
    while True:
        try:
            return *child.communicate(timeout=_WATCH_S), ""
        except subprocess.TimeoutExpired:
            why = ""
            if memory_of(child) > most_bytes:
                why = f"its reader took more than {shown_bytes(most_bytes)} of memory"
            elif time.monotonic() > end:
                why = f"its reader took more than {most_s:.0f} s"
        if why:
            child.kill()
            return *child.communicate(), why


def _end(status: int) -> str:
    return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
