"""Takes the build's folder out of a wheel: in maturin's bill of materials the workspace's crates are paths."""

import base64
import hashlib
import zipfile
from pathlib import Path

from release.project import ROOT

BILL = ".cyclonedx.json"


def scrub(wheel: Path) -> None:
    """Write the wheel again with paths relative to the project; times and order of its files stay."""
    folder = ROOT.as_uri().encode() + b"/"
    with zipfile.ZipFile(wheel) as old:
        members = [(entry, old.read(entry)) for entry in old.infolist()]
    bills = {
        entry.filename: content.replace(folder, b"")
        for entry, content in members
        if entry.filename.endswith(BILL)
    }
    fresh = wheel.with_suffix(".new")
    with zipfile.ZipFile(fresh, "w", zipfile.ZIP_DEFLATED) as new:
        for entry, content in members:
            changed = bills.get(entry.filename, content)
            new.writestr(entry, _record(content, bills) if entry.filename.endswith("/RECORD") else changed)
    fresh.replace(wheel)


def _record(record: bytes, changed: dict[str, bytes]) -> bytes:
    lines = record.decode().splitlines()
    return "".join(f"{_line(line, changed)}\n" for line in lines).encode()


def _line(line: str, changed: dict[str, bytes]) -> str:
    name = line.split(",")[0]
    if name not in changed:
        return line
    digest = base64.urlsafe_b64encode(hashlib.sha256(changed[name]).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(changed[name])}"
