"""The committed player and live page are what their source builds, to the bit; their parts are pinned and licensed."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "viewer"
FOLDERS = {"player": ROOT / "python/oarlock/report/viewer", "live": ROOT / "python/oarlock/live/page"}
HOLDERS = {"player": ("three.js authors", "Leon Sorokin"), "live": ("three.js authors",)}
BUILT = [f"{name}.{kind}" for name in FOLDERS for kind in ("js", "css", "licences.txt")]
MOST_LINES = 500
LARGEST_BYTES = 700_000
UNREACHABLE = ("ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED", "ECONNRESET", "ETIMEDOUT", "ENETUNREACH", "network")


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the source with its tools installed."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("THE PLAYER WAS NOT BUILT: node and npm are needed (apt-get install nodejs npm)")
    folder = tmp_path_factory.mktemp("viewer")
    shutil.copytree(SOURCE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("node_modules"))
    done = subprocess.run(["npm", "ci", "--no-progress"], cwd=folder, capture_output=True, text=True)
    if done.returncode and any(sign in done.stderr for sign in UNREACHABLE):
        pytest.skip(f"THE PLAYER WAS NOT BUILT: npm cannot reach its registry: {done.stderr.strip()[:200]}")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.long
@pytest.mark.parametrize("name", BUILT)
def test_the_committed_player_is_what_its_source_builds(workshop, name):
    out = workshop / "out"
    if not out.exists():
        subprocess.run(["node", "build.mjs", str(out)], cwd=workshop, check=True, capture_output=True)
    committed = FOLDERS[name.partition(".")[0]] / name
    same = (out / name).read_bytes() == committed.read_bytes()
    assert same, f"{name} differs from its source: cd viewer && npm ci && npm run build"


def test_tools_are_pinned_and_no_registry_is_named():
    lock = json.loads((SOURCE / "package-lock.json").read_text(encoding="utf-8"))
    packages = {name: about for name, about in lock["packages"].items() if name}
    assert not [name for name, about in packages.items() if "resolved" in about]
    assert all(about["integrity"].startswith("sha512-") for about in packages.values())
    wanted = json.loads((SOURCE / "package.json").read_text(encoding="utf-8"))["devDependencies"]
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", version) for version in wanted.values())
    assert {name: packages[f"node_modules/{name}"]["version"] for name in wanted} == wanted


@pytest.mark.parametrize("name", FOLDERS)
def test_licences_travel_with_every_copy(name):
    text = (FOLDERS[name] / f"{name}.licences.txt").read_text(encoding="utf-8")
    for holder in HOLDERS[name]:
        assert holder in text
    assert text.count("Permission is hereby granted") == len(HOLDERS[name])
    assert text in (FOLDERS[name] / f"{name}.js").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", FOLDERS)
def test_a_bundle_is_small_and_fetches_nothing(name):
    script = (FOLDERS[name] / f"{name}.js").read_text(encoding="utf-8")
    assert len(script.encode()) < LARGEST_BYTES
    assert not re.search(r"\bimport\s*\(|\bfetch\(\s*[\"'`]http", script)
    assert "</script" not in script.lower()


SOURCES = sorted(path for path in SOURCE.glob("src/**/*") if path.is_file())


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(SOURCE / "src")))
def test_source_files_are_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES
