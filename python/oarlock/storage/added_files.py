"""Adds files to a folder, such as a page to a track, without changing the others; verbs that write pages use it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import FolderWriter, read_manifest
from oarlock.storage.regular_file import read_bytes
from oarlock.storage.write_file import check_replaceable, unwritable, write_file


@contextmanager
def added_files(folder: Path, force: bool = False, kind: str | None = None) -> Iterator[Path]:
    """Context that gives an empty folder to write into; at its end its files are moved into `folder`.

    If `folder` has a manifest or gets one, they are listed there and appear together; else each is replaced as a whole.

    Args:
        folder: where the files shall be.
        force: replace files of others, too.
        kind: what the folder is, so that it gets a manifest if it has none; None: any folder of a user.

    Raises:
        DataError: as `check_free`, or another process writes into the folder, or it cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="oarlock-") as temporary:
        stage = Path(temporary)
        yield stage
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritable(folder, error) from error
        before = read_manifest(folder)
        files = {file.name: read_bytes(file) for file in sorted(stage.iterdir())}
        if before is not None or kind is not None:
            writer = FolderWriter(folder, kind or next(iter(before.kinds if before else ()), "page"), force)
            try:
                for name, contents in files.items():
                    write_file(writer.stage / name, contents)
                writer.commit_beside()
            finally:
                writer.abandon()
            return
        for name in files:
            check_free(folder / name, force)
        for name, contents in files.items():
            write_file(folder / name, contents)


def check_free(file: Path, force: bool = False) -> None:
    """Refuse to replace a file of somebody else. Ours are those that stand unchanged in the folder's manifest.

    Raises:
        DataError: it exists, also as a link, and `force` is not set; or it is a folder or a device.
    """
    check_replaceable(file)
    if not os.path.lexists(file) or force:
        return
    manifest = read_manifest(file.parent)
    if manifest is None or not manifest.is_unchanged(file.name):
        raise DataError(f"{file} exists\nChoose another file, or add --force.")
