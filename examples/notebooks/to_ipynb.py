"""Writes each notebook of this folder for Jupyter too: `python examples/notebooks/to_ipynb.py` (needs marimo)."""

import json
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
NOTEBOOKS = sorted(
    path for path in FOLDER.glob("*.py") if "\napp = marimo.App(" in path.read_text(encoding="utf-8")
)


def ipynb(notebook: Path) -> str:
    """The text of the Jupyter notebook, without outputs and without the import that only marimo needs."""
    command = [sys.executable, "-m", "marimo", "export", "ipynb", str(notebook), "--sort", "top-down"]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=True)
    page = json.loads(done.stdout)
    page["cells"] = [cell for cell in page["cells"] if "".join(cell["source"]) != "import marimo as mo"]
    for number, cell in enumerate(page["cells"]):
        cell |= {"id": f"cell-{number}", "metadata": {}}
    page["metadata"] = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return json.dumps(page, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for path in NOTEBOOKS:
        path.with_suffix(".ipynb").write_text(ipynb(path), encoding="utf-8")
