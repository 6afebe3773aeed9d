"""`search`: looks for an athlete in every file of a season, on all processors."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

from oarlock.season.disk import Disk
from oarlock.season.place import Place
from oarlock.season.traces import Sought, Trace, traces_in

_MANY = 2000
"""From so many files on, the start of further processes pays."""
_MOST_WORKERS = 8
_READERS = 16
_WORKER = "from oarlock.season.search import _worker; _worker()"


def search(
    place: Place,
    sought: Sought,
    names: Iterable[str] | None = None,
    told: Callable[[float], None] | None = None,
) -> list[Trace]:
    """All traces in the files of a place.

    Args:
        place: the season's.
        sought: what is searched for.
        names: of the files; None is every file.
        told: called with the share done, 0 to 1.
    """
    files = [name for name, _ in place.files("")] if names is None else list(names)
    tell = told or (lambda share: None)
    if isinstance(place, Disk):
        workers = min(os.cpu_count() or 1, _MOST_WORKERS) if len(files) >= _MANY else 1
        found = _on_disk(place, sought, files, workers, tell)
    else:
        found = []
        with ThreadPoolExecutor(_READERS) as pool:
            for done, own in enumerate(pool.map(lambda name: _of_file(place, name, sought), files), start=1):
                found += own
                tell(done / len(files))
    return sorted(found, key=lambda one: (one.file, one.where))


def _on_disk(
    place: Disk, sought: Sought, files: Sequence[str], workers: int, tell: Callable[[float], None]
) -> list[Trace]:
    with ExitStack() as stack:
        others = []
        for first in range(1, workers):
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", _WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE
                )
            )
            stack.callback(process.terminate)  # after Ctrl-C; nothing happens to one that has ended
            assert process.stdin is not None
            pickle.dump((str(place.root), sought, files[first::workers]), process.stdin)
            process.stdin.close()
            others.append(process)
        found: list[Trace] = []
        own = files[::workers]
        for done, name in enumerate(own, start=1):
            found += _of_file(place, name, sought)
            tell(done / len(own))
        for first, process in enumerate(others, start=1):
            assert process.stdout is not None
            try:
                found += pickle.load(process.stdout)
            except (EOFError, pickle.UnpicklingError):  # it ended early: its files are searched here
                found += [one for name in files[first::workers] for one in _of_file(place, name, sought)]
    return found


def _worker() -> None:
    """A further process: reads what to search, writes what it found."""
    root, sought, files = pickle.load(sys.stdin.buffer)
    from pathlib import Path

    place = Disk(Path(root))
    pickle.dump([one for name in files for one in _of_file(place, name, sought)], sys.stdout.buffer)


def _of_file(place: Place, name: str, sought: Sought) -> list[Trace]:
    try:
        return traces_in(name, place.read(name), sought)
    except FileNotFoundError:
        return []  # gone meanwhile
    except OSError as error:
        return [Trace(name, "its contents", f"cannot be read ({error.strerror})", is_unsearched=True)]
