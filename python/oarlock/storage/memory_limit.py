"""Memory: refuses requests whose result could not fit into this machine, and measures what a child process takes."""

from __future__ import annotations

import contextlib
import ctypes
import os
import subprocess
import sys

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import shown_bytes

_USUAL_BYTES = 16e9


def check_memory(needed_bytes: float, what: str, advice: str) -> None:
    """Compare an estimate with the memory of the machine.

    Args:
        needed_bytes: estimate of the arrays' size.
        what: what needs them, for the error.
        advice: what to try, a sentence.

    Raises:
        DataError: it is more than the machine has.
    """
    present = _present_bytes()
    if not needed_bytes <= present:
        raise DataError(
            f"{what} would need about {shown_bytes(needed_bytes)} of memory; this machine has "
            f"{shown_bytes(present)}. {advice}"
        )


def memory_of(child: subprocess.Popen[bytes]) -> int:
    """Memory that a child process has now, in bytes; 0 if the system does not say."""
    if sys.platform == "win32":
        # PROCESS_MEMORY_COUNTERS: two numbers of 4 bytes, then eight sizes, of which the seventh is PagefileUsage.
        counters = (ctypes.c_size_t * 9)()
        kernel, size = ctypes.windll.kernel32, ctypes.sizeof(counters)
        known = kernel.K32GetProcessMemoryInfo(
            ctypes.c_void_p(int(child._handle)), ctypes.byref(counters), size
        )
        return int(counters[7]) if known else 0
    with contextlib.suppress(OSError, ValueError, subprocess.SubprocessError):
        asked = ["ps", "-o", "rss=", "-p", str(child.pid)]
        return 1024 * int(subprocess.check_output(asked, stderr=subprocess.DEVNULL, timeout=10))
    return 0


def _present_bytes() -> float:
    """Physical memory; a usual value where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return _USUAL_BYTES
