"""The public names: all of them resolve, and importing the package loads no library that is not yet needed."""

import subprocess
import sys

import pytest

import oarlock
import oarlock.rowing

HEAVY = ("numpy", "scipy", "pyarrow", "rich", "typer")


def loaded_by(code: str) -> set[str]:
    """Which heavy libraries a fresh process holds after running some code."""
    asked = f"import sys\n{code}\nprint(*(name for name in {HEAVY} if name in sys.modules), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    return set(done.stderr.split())


def test_importing_the_package_loads_no_library():
    assert loaded_by("import oarlock, oarlock.rowing; dir(oarlock)") == set()


@pytest.mark.parametrize("argument", ["--version", "--help"])
def test_version_and_help_load_the_parser_only(argument):
    code = f"from oarlock.cli import app\ntry: app(['{argument}'])\nexcept SystemExit: pass"
    assert loaded_by(code) == {"typer"}


@pytest.mark.parametrize("package", [oarlock, oarlock.rowing], ids=["oarlock", "oarlock.rowing"])
def test_every_public_name_resolves(package):
    assert set(package.__all__) == set(dir(package))
    assert all(getattr(package, name) is not None for name in package.__all__)
    with pytest.raises(AttributeError, match="no_such_name"):
        package.no_such_name  # noqa: B018


def test_a_star_import_brings_every_name():
    found: dict[str, object] = {}
    exec("from oarlock import *", found)
    assert set(oarlock.__all__) <= set(found)


def test_the_engine_takes_the_names_of_its_parameters():
    model = oarlock.load_model("arm7")
    tracker = oarlock.Tracker(model=model, calibration=None, config=oarlock.Config(), belief=None)
    assert tracker.state_names == oarlock.Tracker(model).state_names
