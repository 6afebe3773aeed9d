"""What the files of a release have to agree with: the version, the size budget, the files of the package."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHON = ROOT / "python"
EXAMPLES = ROOT / "examples"
# PyO3's feature abi3-py311: one wheel for Python 3.11 and every later one.
ABI_TAG = "cp311-abi3"
WHEEL_BUDGET_BYTES = 8_000_000
UNSHIPPED = {".so", ".pyd", ".pyc"}


def version() -> str:
    """The version, as Cargo.toml states it."""
    text = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    return str(tomllib.loads(text)["workspace"]["package"]["version"])


def package_files() -> set[str]:
    """Files of the package as the wheel names them: modules, pages, models and the example recordings."""
    modules = {path.relative_to(PYTHON) for path in _files(PYTHON / "oarlock")}
    examples = {"oarlock/data" / path.relative_to(EXAMPLES) for path in _files(EXAMPLES)}
    return {path.as_posix() for path in modules | examples}


def _files(folder: Path) -> list[Path]:
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix not in UNSHIPPED]
    # Caches of tools have names that begin with a dot.
    return [path for path in files if not any(part[0] == "." for part in path.relative_to(folder).parts)]
