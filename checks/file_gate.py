"""Files are opened in one place, `oarlock.storage.regular_file`, which refuses pipes, devices and folders."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from checks.arrows import PACKAGE, python_files
from checks.project_files import text_of

GATE = "storage/regular_file.py"
# What opens a file by its path or decodes one, as it is called. Contents of the package itself are no files of users.
OPENS = re.compile(
    r"(?:(?:io|os|codecs|gzip|bz2|lzma|tarfile|wave|shelve|av|fitz|Image)\.)?open|os\.fdopen"
    r"|(?:np|numpy)\.(?:load|loadtxt|genfromtxt|fromfile|memmap)|(?:pd|pandas|pl|polars)\.(?:read|scan)_\w+"
    r"|(?:(?:pq|parquet)\.)?(?:ParquetFile|ParquetDataset|read_metadata|read_schema)|(?:pq|parquet)\.read_\w+"
    r"|(?:pa\.|pyarrow\.)?(?:csv|feather|orc|json)\.(?:read|open)_\w+|(?:pa\.)?(?:memory_map|OSFile|input_stream)"
    r"|(?:h5py\.)?File|(?:zipfile\.)?ZipFile|mmap\.mmap|(?:sqlite3|duckdb)\.connect|fileinput\.input|linecache\.getline"
    r"|(?:scipy\.io\.|sio\.)?loadmat|ezc3d\.c3d|(?:\w+\.)?(?:iterparse|make_reader)|ElementTree\.parse|ET\.parse"
)
PATH_METHODS = {"read_text", "read_bytes"}
MODE = re.compile(r"[rwaxbt+U]{1,4}")
PACKAGED = re.compile(r"\bfiles\(")
WRITES, SHIPPED = "writes", "files of the package"
CHILD = (
    "in the child process, whose crash costs nothing, after the parent has opened the file through the gate"
)
# Calls beside the gate, by file: how many, and why.
ALLOWED: dict[str, tuple[int, str]] = {
    "evaluation/comparison/comparison.py": (1, "/proc/cpuinfo, whose size the system does not say"),
    "evaluation/study/pool.py": (1, WRITES),
    "formats/archive.py": (2, "a zip file that the gate has opened, and what is written of it"),
    "formats/child_process.py": (1, "arrays that the child has written into memory"),
    "formats/export/animation.py": (1, "an empty C3D file to fill"),
    "formats/reader_child.py": (7, CHILD),
    "live/doctor/network.py": (3, "/proc and /etc"),
    "live/doctor/permissions.py": (1, "/sys"),
    "live/event_log.py": (1, WRITES),
    "live/page/__init__.py": (2, SHIPPED),
    "live/recorder.py": (1, WRITES),
    "live/transports/udp.py": (1, "/proc"),
    "movement/video/reading.py": (1, "FFmpeg seeks in a file that the gate has opened before"),
    "cli/terminal.py": (1, "the null device, in place of a terminal that is gone"),
    "report/summary_page.py": (1, SHIPPED),
    "rowing/analysis/features.py": (1, SHIPPED),
    "season/database.py": (1, "a database in memory"),
    "season/processes.py": (2, "errors of a process, and the pipe to its parent"),
    "season/storage.py": (1, WRITES),
    "season/tables.py": (2, "a file that the gate has opened, and one in memory"),
    "storage/folder_writer.py": (1, WRITES),
    "storage/write_file.py": (2, WRITES),
}


def findings(package: Path = PACKAGE, allowed: dict[str, tuple[int, str]] | None = None) -> list[str]:
    """Calls beside the gate in files that may not have as many, and permissions that nothing needs."""
    allowed = ALLOWED if allowed is None else allowed
    faults = []
    calls = {
        file.relative_to(package).as_posix(): list(openings(text_of(file)))
        for file in python_files(package)
        if file.suffix == ".py"
    }
    for name, lines in calls.items():
        allowed_count = allowed.get(name, (0, ""))[0]
        if name != GATE and len(lines) > allowed_count:
            faults += [
                f"{name}:{line}: {call}: open it with oarlock.storage.regular_file, or name the reason in "
                "checks/file_gate.py"
                for line, call in lines
            ]
    return faults + [
        f"checks/file_gate.py: {name} opens {len(calls.get(name, ()))} files now; correct its line"
        for name, (allowed_count, _) in allowed.items()
        if len(calls.get(name, ())) < allowed_count
    ]


def openings(text: str) -> Iterator[tuple[int, str]]:
    """Line and name of each call that opens or decodes a file."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call):
            continue
        function = ast.unparse(node.func)
        if OPENS.fullmatch(function) or _is_of_a_path(node, function):
            yield node.lineno, function.rpartition("\n")[2]


def _is_of_a_path(node: ast.Call, function: str) -> bool:
    if not isinstance(node.func, ast.Attribute) or PACKAGED.search(function):
        return False
    if node.func.attr in PATH_METHODS:
        return True
    mode = node.args[0] if node.args else None
    return node.func.attr == "open" and (
        (mode is None and not isinstance(node.func.value, ast.Name))
        or (
            isinstance(mode, ast.Constant)
            and isinstance(mode.value, str)
            and bool(MODE.fullmatch(mode.value))
        )
    )
