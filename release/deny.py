"""Runs cargo-deny on the Rust dependencies: licences, bans and sources, as deny.toml says."""

import shutil
import subprocess

from release.project import ROOT

INSTALL = "cargo install --locked cargo-deny"


def deny() -> bool | None:
    """Whether all is allowed; nothing without cargo-deny, which is then said. Needs no network.

    Advisories need a database from the network: the workflow advisories.yml checks them.
    """
    if not shutil.which("cargo-deny"):
        print(f"SKIPPED: licences, bans and sources of the Rust dependencies. Try: {INSTALL}", flush=True)
        return None
    command = ["cargo", "deny", "--locked", "--all-features", "check", "licenses", "bans", "sources"]
    return subprocess.run(command, cwd=ROOT).returncode == 0
