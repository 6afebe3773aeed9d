"""Reads a wheel or a source distribution: its files, their sizes and bytes."""

import tarfile
import zipfile
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Archive:
    """A file to publish. Names in a source distribution are without the folder that contains them all."""

    path: Path
    members: dict[str, bytes]

    @property
    def bytes_packed(self) -> int:
        """Size of the file."""
        return self.path.stat().st_size

    @property
    def is_wheel(self) -> bool:
        """Whether it is a wheel; otherwise a source distribution."""
        return self.path.suffix == ".whl"


def read(path: Path) -> Archive:
    """The archive with all its contents.

    Raises:
        ValueError: the file is neither a wheel nor a source distribution.
    """
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as file:
            return Archive(path, {name: file.read(name) for name in file.namelist()})
    if path.name.endswith(".tar.gz"):
        return Archive(path, _members(path))
    raise ValueError(f"{path}: expected a wheel (.whl) or a source distribution (.tar.gz)")


def _members(path: Path) -> dict[str, bytes]:
    members = {}
    with tarfile.open(path) as file:
        for member in file.getmembers():
            content = file.extractfile(member)
            if content:
                members[member.name.partition("/")[2]] = content.read()
    return members


def listing(archive: Archive) -> str:
    """One line for each folder, two levels deep: number of files and kilobytes unpacked."""
    folders: dict[str, list[int]] = {}
    for name, content in archive.members.items():
        folders.setdefault("/".join(name.split("/")[:-1][:2]) or ".", []).append(len(content))
    lines = [
        f"{len(sizes):6d} files {sum(sizes) / 1e3:9.1f} kB  {folder}"
        for folder, sizes in sorted(folders.items())
    ]
    return "\n".join([f"{archive.path.name}: {archive.bytes_packed / 1e6:.2f} MB packed", *lines])
