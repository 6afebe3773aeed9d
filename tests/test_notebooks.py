"""The notebooks of examples/notebooks run from beginning to end, in marimo and in Jupyter."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples/notebooks"
NAMES = ("arm", "club_csv", "filter", "instrumented_boat", "own_model")
LARGEST_BYTES = 20_000
HANGS_S = 1800
ENVIRONMENT = os.environ | {"MPLBACKEND": "Agg"}


def test_every_story_is_here_for_marimo_and_jupyter():
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NAMES)
    assert set(NAMES) <= {path.stem for path in FOLDER.glob("*.py")}


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_are_small_and_without_outputs(name):
    text = (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
    assert len(text.encode()) < LARGEST_BYTES
    assert not any(cell.get("outputs") for cell in json.loads(text)["cells"])


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_the_jupyter_notebook_is_that_of_marimo(name):
    pytest.importorskip("marimo")
    code = f"import sys; sys.path.insert(0, {str(FOLDER)!r}); import to_ipynb\n"
    code += f"sys.stdout.write(to_ipynb.ipynb(to_ipynb.FOLDER / '{name}.py'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    assert done.stdout == (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"), (
        "run examples/notebooks/to_ipynb.py"
    )


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_the_marimo_notebook_runs(name):
    pytest.importorskip("marimo")
    done = subprocess.run(
        [sys.executable, str(FOLDER / f"{name}.py")],
        capture_output=True,
        text=True,
        env=ENVIRONMENT,
        timeout=HANGS_S,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_the_jupyter_notebook_runs(name):
    pytest.importorskip("nbclient")
    code = "import sys, nbformat; from nbclient import NotebookClient\n"
    code += (
        f"NotebookClient(nbformat.read(sys.argv[1], 4), timeout={HANGS_S}, kernel_name='python3').execute()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(FOLDER / f"{name}.ipynb")],
        capture_output=True,
        text=True,
        timeout=HANGS_S,
    )
    assert done.returncode == 0, done.stderr
