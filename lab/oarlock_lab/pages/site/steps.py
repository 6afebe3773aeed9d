"""Runs the commands and Python blocks of a page in the order in which a reader meets them; for tutorials and tests.

Each line of an `sh` or `console` block is a command, each `python` block a program. A block with `title="FILE"` is
written to that file. What `presumed.py` lists is not run.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from .presumed import ABSENT, BACKGROUND, PSEUDONYM, SERVERS, SESSION, not_run, quicker

BLOCK = re.compile(r'^```(\w+)(?: title="([\w.-]+)")?\n(.*?)^```$', re.M | re.S)
ADDRESS = re.compile(r"https?://127\.0\.0\.1:\d+/\S*")
STARTS_S, ENDS_S, POLL_S = 60.0, 60.0, 0.05
SERVED_S = 4.0
"""How long a server serves before Ctrl-C, so that a live session has something to record."""
STOPPED = (0, 130)


@dataclass(frozen=True)
class Step:
    """A command, a Python block, or a file that the page asks the reader to write.

    Args:
        text: the command, the program or the file's contents.
        kind: `command`, `python` or `file`.
        file: name of the file; empty otherwise.
    """

    text: str
    kind: str = "command"
    file: str = ""

    @property
    def title(self) -> str:
        """The command, or the first line of a program that does more than import."""
        if self.kind == "command":
            return self.text
        lines = [
            line for line in self.text.splitlines() if line and not line.startswith(("import ", "from "))
        ]
        return f"python: {lines[0] if lines else self.text.splitlines()[0]}"


def steps(page: str) -> Iterator[Step]:
    """The commands, programs and files of a page, in order."""
    for language, file, text in BLOCK.findall(page):
        if file:
            yield Step(text, "file", file)
        elif language == "python":
            yield Step(text, "python")
        elif language in ("sh", "console"):
            lines = text.replace("\\\n", " ").splitlines()
            yield from (Step(line.strip()) for line in lines if line.strip() and not line.startswith("#"))


def with_reasons(page: str) -> Iterator[tuple[Step, str]]:
    """The steps of a page, each with the reason why it is not run; "" if it is.

    What an absent recording would have been made into is missing in later steps, too.
    """
    lost: set[str] = set()
    for step in steps(page):
        why = not_run(step.text)
        missing = next((name for name in lost if re.search(rf"\b{re.escape(name)}/", step.text)), "")
        why = why or (f"{missing}/ {ABSENT}" if missing else "")
        if ABSENT in why and (out := re.search(r"--out (\S+)", step.text)):
            lost.add(out[1])
        yield step, why


class Reader:
    """Follows a page in a folder, with the `oarlock` and `python` of a folder of programs.

    Args:
        folder: where the commands run; its `home` is the reader's home.
        programs: such as `bin` of a virtual environment.

    Raises:
        RuntimeError: a command failed.
    """

    def __init__(self, folder: Path, programs: Path) -> None:
        self.folder = folder
        self.environment = environment(programs, folder / "home")
        self.running: list[subprocess.Popen[bytes]] = []

    def follow(self, page: str) -> list[tuple[str, float]]:
        """Run all steps of a page; each command with its seconds."""
        runnable = (step for step, why in with_reasons(page) if not why)
        try:
            return [(step.title, self.run(step)) for step in runnable if not self.wrote(step)]
        finally:
            for process in self.running:
                _stop(process)

    def wrote(self, step: Step) -> bool:
        """Whether the step is a file, which is now written, or a variable, which is now set."""
        if step.kind == "file":
            (self.folder / step.file).write_text(step.text, encoding="utf-8")
        elif step.text.startswith("export "):
            name = step.text.removeprefix("export ").split("=")[0]
            self.environment[name] = self.finish(f'{step.text}; printf %s "${name}"')
        else:
            return False
        return True

    def run(self, step: Step) -> float:
        """Seconds that a command or a program took."""
        text = quicker(step.text)
        if PSEUDONYM in text:
            text = text.replace(PSEUDONYM, self.pseudonym())
        begin = time.perf_counter()
        if step.kind == "python":
            self.program(text)
        elif text.startswith(SERVERS):
            self.serve(text, lambda address: time.sleep(SERVED_S))
        elif text.startswith(BACKGROUND):
            self.start(text, "_background.txt")
            time.sleep(1.0)
        else:
            self.finish(text)
        return time.perf_counter() - begin

    def program(self, text: str) -> None:
        """Run a Python block; one that looks at a live session, beside the demo."""
        file = self.folder / "_block.py"
        file.write_text(text, encoding="utf-8")
        if SESSION not in text:
            self.finish("python _block.py", text)
            return

        def looking(address: str) -> None:
            file.write_text(text.replace(SESSION, address), encoding="utf-8")
            looker.append(self.start("python _block.py", "_looking.txt"))
            time.sleep(SERVED_S)

        looker: list[subprocess.Popen[bytes]] = []
        self.serve("oarlock live demo", looking)
        if looker[0].wait(ENDS_S):
            raise RuntimeError(f"{text}\n{self.output('_looking.txt')}")

    def finish(self, command: str, expected: str = "") -> str:
        """Run a command to its end; what it printed."""
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        if done.returncode:
            output = f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
            raise RuntimeError(f"{expected or command}\nexit status {done.returncode}\n{output}")
        return done.stdout

    def start(self, command: str, output: str = "_output.txt") -> subprocess.Popen[bytes]:
        """Run a command beside the others."""
        with (self.folder / output).open("wb") as file:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {command}"],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self.running.append(process)
        return process

    def output(self, name: str = "_output.txt") -> str:
        """What the last command that was started has printed."""
        return (self.folder / name).read_text(encoding="utf-8", errors="replace")

    def serve(self, command: str, meanwhile: Callable[[str], None]) -> None:
        """Start a server on a free port, look at its page, and end it by Ctrl-C."""
        process = self.start(f"{command} --port 0")
        address = self.address(process, command)
        with urllib.request.urlopen(address, timeout=STARTS_S) as answer:
            if b"<html" not in answer.read():
                raise RuntimeError(f"{command}\n{address} shows no page")
        meanwhile(address)
        status = _stop(process)
        if status not in STOPPED or "Traceback" in self.output():
            raise RuntimeError(f"{command}\nexit status {status} after Ctrl-C\n{self.output()[-3000:]}")

    def address(self, process: subprocess.Popen[bytes], command: str) -> str:
        """The address that a server prints."""
        ends = time.monotonic() + STARTS_S
        while not (match := ADDRESS.search(self.output())):
            if process.poll() is not None or time.monotonic() > ends:
                raise RuntimeError(f"{command}\nno address of a page\n{self.output()[-2000:]}")
            time.sleep(POLL_S)
        return match.group()

    def pseudonym(self) -> str:
        """The first athlete of the page's season, in place of the one that the page names."""
        return min(path.name.partition("=")[2] for path in self.folder.glob("season/athlete=*"))


def _stop(process: subprocess.Popen[bytes]) -> int:
    """Ctrl-C in the terminal of a process; its exit status."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
    return process.wait()


def environment(programs: Path, home: Path) -> dict[str, str]:
    """Without what would let the checkout's package be found before the one that is installed there."""
    variables = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "OARLOCK", "VIRTUAL_ENV"))
    }
    if programs == Path(sys.executable).parent and "PYTHONPATH" in os.environ:  # the checkout itself
        variables["PYTHONPATH"] = os.environ["PYTHONPATH"]
    home.mkdir(exist_ok=True)
    caches = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    return {
        **variables,
        "PATH": f"{programs}{os.pathsep}{variables.get('PATH', '')}",
        "BROWSER": "true",
        "MPLBACKEND": "Agg",
        "HOME": str(home),
        "XDG_STATE_HOME": str(home / ".local/state"),
        "XDG_CACHE_HOME": caches,
    }
