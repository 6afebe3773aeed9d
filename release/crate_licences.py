"""The licences of the Rust crates in the compiled module, as one text for wheels and the source distribution."""

import json
import subprocess
from pathlib import Path
from typing import Any

from release.project import ROOT

FILE = ROOT / "THIRDPARTY.txt"
PACKAGE = "oarlock-py"
NAMES = ("LICENSE", "LICENCE", "COPYING", "NOTICE", "COPYRIGHT")
RULE = "-" * 100


def text() -> str:
    """Each licence once, below the crates that it covers. Of a choice that includes MIT, MIT is taken.

    Raises:
        subprocess.CalledProcessError: cargo cannot read the workspace.
    """
    covered: dict[str, list[str]] = {}
    for crate in sorted(_crates(), key=lambda crate: (crate["name"], crate["version"])):
        name = f"{crate['name']} {crate['version']} ({crate['license']})"
        for licence in _licences(Path(crate["manifest_path"]).parent) or [
            f"Licensed under {crate['license']}."
        ]:
            covered.setdefault(licence, []).append(name)
    parts = [f"{RULE}\n{', '.join(names)}\n{RULE}\n\n{licence}\n" for licence, names in covered.items()]
    return "The compiled module of Oarlock contains these Rust crates.\n\n" + "\n".join(parts)


def _crates() -> list[dict[str, Any]]:
    command = ["cargo", "metadata", "--locked", "--format-version", "1"]
    metadata = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    whole = json.loads(metadata)
    packages = {package["id"]: package for package in whole["packages"]}
    nodes = {node["id"]: node["deps"] for node in whole["resolve"]["nodes"]}
    waiting = [identity for identity, package in packages.items() if package["name"] == PACKAGE]
    linked: set[str] = set()
    while waiting:
        identity = waiting.pop()
        if identity not in linked:
            linked.add(identity)
            # neither tests nor build scripts are compiled into the module
            waiting += [
                dep["pkg"]
                for dep in nodes[identity]
                if any(kind["kind"] is None for kind in dep["dep_kinds"])
            ]
    return [packages[identity] for identity in linked if packages[identity]["source"]]


def _licences(folder: Path) -> list[str]:
    files = sorted(
        path for path in folder.iterdir() if path.is_file() and path.name.upper().startswith(NAMES)
    )
    mit = [path for path in files if "MIT" in path.name.upper()]
    return [_plain(path.read_text(encoding="utf-8")) for path in mit or files]


def _plain(licence: str) -> str:
    lines = [line.rstrip() for line in licence.replace("\t", "    ").splitlines()]
    return "\n".join(lines).strip()
