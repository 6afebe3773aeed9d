"""Checks the contents of a wheel or a source distribution; each check returns its findings as lines."""

import json
import re
from email.parser import BytesParser

from release import project
from release.archive import Archive

# Folders of the machine that built it. Rust's own sources are below /rustc and name no machine.
MACHINE_PATH = re.compile(rb"/(?:root|home|tmp|work|Users|builds)/[\w.@-]+|[A-Z]:\\+(?:Users|a)\\+\w+")
NEEDED_IN_WHEEL = {"oarlock/py.typed", "oarlock/_core.pyi", "oarlock/__init__.pyi"}
NEEDED_IN_SOURCE = {
    "PKG-INFO",
    "pyproject.toml",
    "Cargo.toml",
    "Cargo.lock",
    "LICENSE",
    "NOTICE",
    "THIRDPARTY.txt",
    "README.md",
    "crates/oarlock-py/build.rs",
    "viewer/package-lock.json",
    "viewer/src/main.js",
    "release/javascript.cdx.json",
}
LICENCES = {"licenses/LICENSE", "licenses/NOTICE", "licenses/THIRDPARTY.txt"}
BILLS = {"sboms/oarlock-py.cyclonedx.json", "sboms/javascript.cdx.json"}


def findings(archive: Archive) -> list[str]:
    """Everything that is wrong with the archive."""
    of_kind = _wheel if archive.is_wheel else _source
    return [*of_kind(archive), *_machine_paths(archive)]


def _wheel(archive: Archive) -> list[str]:
    information = f"oarlock-{project.version()}.dist-info/"
    ours = {name for name in archive.members if not name.startswith(information)}
    compiled = {name for name in ours if re.fullmatch(r"oarlock/_core\.(?:abi3\.so|pyd)", name)}
    about = {name.removeprefix(information) for name in set(archive.members) - ours}
    return [
        *_tag(archive),
        *_size(archive),
        *_version(archive, information + "METADATA"),
        *([] if len(compiled) == 1 else [f"compiled modules: {sorted(compiled)}, expected one"]),
        *_missing(NEEDED_IN_WHEEL | project.package_files(), ours),
        *_missing(LICENCES | BILLS, about),
        *(f"{name}: is no file of the package" for name in sorted(ours - compiled - project.package_files())),
        *_bills(archive, information),
    ]


def _source(archive: Archive) -> list[str]:
    files = {f"python/{name}" for name in project.package_files() if not name.startswith("oarlock/data/")}
    examples = {
        f"examples/{name.removeprefix('oarlock/data/')}"
        for name in project.package_files()
        if name.startswith("oarlock/data/")
    }
    built = [
        name
        for name in archive.members
        if re.search(r"\.(?:so|pyd|pyc)$|(?:^|/)(?:target|node_modules)/", name)
    ]
    return [
        *_version(archive, "PKG-INFO"),
        *_missing(NEEDED_IN_SOURCE | files | examples, set(archive.members)),
        *(f"{name}: is built, not source" for name in sorted(built)),
        *(f"{name}: belongs to oarlock-lab" for name in sorted(archive.members) if name.startswith("lab/")),
    ]


def _tag(archive: Archive) -> list[str]:
    tag = re.fullmatch(r"oarlock-([^-]+)-(cp\d+-\w+)-([\w.]+)\.whl", archive.path.name)
    if not tag:
        return [f"{archive.path.name}: is no name of a wheel of Oarlock"]
    wrong = [] if tag[2] == project.ABI_TAG else [f"tag {tag[2]}, expected {project.ABI_TAG}"]
    if tag[3].startswith("linux_"):
        wrong.append(f"tag {tag[3]} says nothing about the C library; build it with `make wheel`")
    return wrong


def _size(archive: Archive) -> list[str]:
    over = archive.bytes_packed > project.WHEEL_BUDGET_BYTES
    budget_mb = project.WHEEL_BUDGET_BYTES / 1e6
    return [f"{archive.bytes_packed / 1e6:.2f} MB, the budget is {budget_mb:g} MB"] if over else []


def _version(archive: Archive, name: str) -> list[str]:
    stated = BytesParser().parsebytes(archive.members.get(name, b""))["Version"]
    expected = project.version()
    return [] if stated == expected else [f"{name}: version {stated}, Cargo.toml says {expected}"]


def _missing(needed: set[str], names: set[str]) -> list[str]:
    return [f"{name}: is missing" for name in sorted(needed - names)]


def _bills(archive: Archive, information: str) -> list[str]:
    empty_bills = []
    for name in sorted(BILLS):
        content = archive.members.get(information + name)
        if content is not None and not json.loads(content).get("components"):
            empty_bills.append(f"{name}: lists no component")
    return empty_bills


def _machine_paths(archive: Archive) -> list[str]:
    return [
        f"{name}: contains the path {hit.decode(errors='replace')}"
        for name, content in sorted(archive.members.items())
        for hit in sorted(set(MACHINE_PATH.findall(content)))[:5]
    ]
