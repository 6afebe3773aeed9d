"""Installs a wheel or a source distribution into an empty environment and runs it as a new user does."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from dataclasses import dataclass
from pathlib import Path

from release import project

IMPORT_BUDGET_S = 0.5
COMPILERS = ("cargo", "rustc", "cc", "gcc", "clang", "cl")
# Names are imported when they are first used; these bring NumPy and the engine.
IMPORT = """
import time
before = time.process_time()
import oarlock
oarlock.load_model, oarlock.track
print(time.process_time() - before)
"""
# Every public name, not only those that the first import needs; and the marker for type checkers.
NAMES = """
import importlib.resources, oarlock
missing = [name for name in oarlock.__all__ if not hasattr(oarlock, name)]
assert not missing, missing
assert (importlib.resources.files("oarlock") / "py.typed").is_file()
oarlock.load_model("sculler")
"""


@dataclass(frozen=True)
class Trial:
    """What was measured: seconds by the clock, except the import in processor seconds."""

    install_s: float
    import_s: float
    demo_s: float


def try_out(archive: Path) -> Trial:
    """Install the archive and run it; a wheel without any compiler on the path.

    Raises:
        RuntimeError: a step failed, with its output; or the import takes longer than its budget.
    """
    with tempfile.TemporaryDirectory(prefix="oarlock-trial-") as name:
        place = Path(name)
        venv.create(place / "venv", with_pip=True)
        scripts = place / "venv" / ("Scripts" if os.name == "nt" else "bin")
        return _Run(place, scripts, archive.suffix != ".whl").all(archive.resolve())


class _Run:
    def __init__(self, place: Path, scripts: Path, compilers: bool) -> None:
        self.place, self.scripts = place, scripts
        variables = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        self.environment = variables | {"PATH": os.pathsep.join([str(scripts), *self._path(compilers)])}
        compilers_there = [name for name in COMPILERS if shutil.which(name, path=self.environment["PATH"])]
        if compilers_there and not compilers:
            raise RuntimeError(f"compilers on the path: {', '.join(compilers_there)}")

    def _path(self, compilers: bool) -> list[str]:
        return [os.environ.get("PATH", "")] if compilers else []

    def all(self, archive: Path) -> Trial:
        python = str(self.scripts / "python")
        only_wheels = ["--only-binary", ":all:"] if archive.suffix == ".whl" else []
        install_s = self.timed(python, "-m", "pip", "install", "--quiet", *only_wheels, str(archive))
        stated = self.output(str(self.scripts / "oarlock"), "--version")
        if project.version() not in stated:
            raise RuntimeError(f"oarlock --version: {stated.strip()}, expected {project.version()}")
        import_s = min(float(self.output(python, "-c", IMPORT)) for _ in range(5))
        if import_s > IMPORT_BUDGET_S:
            raise RuntimeError(f"import oarlock takes {import_s:.2f} s, the budget is {IMPORT_BUDGET_S} s")
        self.output(python, "-m", "pip", "install", "--quiet", *only_wheels, f"{archive}[full]")
        self.output(python, "-c", NAMES)
        demo_s = self.timed(str(self.scripts / "oarlock"), "demo", "--out", "demo")
        self.demo_is_whole()
        return Trial(install_s, import_s, demo_s)

    def demo_is_whole(self) -> None:
        reports = sorted(path.parent.name for path in (self.place / "demo").rglob("report.html"))
        if len(reports) < 3:
            raise RuntimeError(f"oarlock demo wrote the reports {reports}, expected three or more")

    def timed(self, *command: str) -> float:
        begun = time.perf_counter()
        self.output(*command)
        return time.perf_counter() - begun

    def output(self, *command: str) -> str:
        done = subprocess.run(command, cwd=self.place, env=self.environment, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command[1:])[:200]}\n{done.stdout}\n{done.stderr}")
        return done.stdout


def report(archive: Path, trial: Trial) -> str:
    """One line."""
    python = ".".join(str(part) for part in sys.version_info[:2])
    facts = {
        "install_s": round(trial.install_s, 1),
        "import_s": round(trial.import_s, 3),
        "demo_s": round(trial.demo_s, 1),
    }
    return f"{archive.name} under Python {python}: {json.dumps(facts)}"
