"""The wheel and the source distribution as `make` builds them, installed into empty environments and run."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]


def done(*command: str) -> str:
    ended = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert ended.returncode == 0, ended.stdout
    return ended.stdout


@pytest.mark.parametrize(("kind", "ending"), [("wheel", "whl"), ("sdist", "tar.gz")])
def test_what_is_built_is_whole_and_runs(kind, ending, tmp_path):
    assert "nothing wrong" in done("make", kind, f"DIST={tmp_path}")
    (file,) = tmp_path.glob(f"*.{ending}")
    assert "import_s" in done(sys.executable, "-m", "release", "try", str(file))


def test_workflows_citation_and_licences_are_in_order():
    said = done("make", "release-checks")
    assert "valid according to schema version 1.2.0" in said and "licenses ok" in said


def test_the_stubs_describe_the_compiled_module():
    stubtest = [
        sys.executable,
        "-m",
        "mypy.stubtest",
        "oarlock._core",
        "--mypy-config-file",
        "pyproject.toml",
    ]
    done(*stubtest, "--ignore-disjoint-bases", "--allowlist", "release/stubs_allowed.txt")
