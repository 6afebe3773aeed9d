"""Commands of the pages: all name verbs and options that exist; those of tutorials and of a season's questions run."""

import re
import shlex
import sys
from pathlib import Path

import pytest
from pages.site import tutorials

from command_line import run
from oarlock.cli import VERBS, load_verb

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(?:sh|console)\n(.*?)^```$", re.M | re.S)


def commands(page):
    text = "\n".join(BLOCK.findall(page.read_text(encoding="utf-8"))).replace("\\\n", " ")
    return [
        line.strip().removeprefix("$ ") for line in text.splitlines() if re.match(r"\s*(\$ )?oarlock\b", line)
    ]


COMMANDS = [(page.name, one) for page in PAGES for one in commands(page)]


def misspelt(command):
    """The first word that `oarlock` does not know, or nothing."""
    words = shlex.split(command.split("||")[0], comments=True)[1:]
    if words[0] not in VERBS:
        return words[0]
    found = load_verb(words.pop(0))
    while words and words[0] in getattr(found, "commands", {}):
        found = found.commands[words.pop(0)]
    found = getattr(found, "commands", {}).get("PATH", found)
    known = {name for one in found.params for name in (*one.opts, *one.secondary_opts)} | {"--help", "-h"}
    return next((word for word in words if word.startswith("-") and word.split("=")[0] not in known), None)


@pytest.mark.parametrize("page", sorted({page for page, _ in COMMANDS}))
def test_commands_of_a_page_have_verbs_and_options_that_exist(page):
    assert {one: misspelt(one) for name, one in COMMANDS if name == page and misspelt(one)} == {}


def test_a_misspelt_option_is_found():
    assert misspelt("oarlock track trial --modell sculler") == "--modell"


def test_no_page_hides_commands_in_an_indented_block():
    found = [page.name for page in PAGES if re.search(r"\n\n    oarlock ", page.read_text(encoding="utf-8"))]
    assert found == []


@pytest.mark.long
@pytest.mark.parametrize("name", tutorials.TUTORIALS)
def test_a_tutorial_runs_as_written(name, tmp_path):
    done = tutorials.run(name, Path(sys.executable).parent, tmp_path)
    assert len(done) >= 5


@pytest.mark.long
def test_a_seasons_questions_run(tmp_path, monkeypatch):
    pytest.importorskip("duckdb")
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs/season-questions.md"
    asked = [shlex.split(one)[1:] for one in commands(page) if "K7QMVA" not in one]
    assert asked[0][:2] == ["season", "synthetic"]
    # as the page says it, with fewer recordings
    run(*asked[0][:3], "--recordings", 60, "--athletes", 3)
    for one in asked[1:]:
        run(*one)
    assert (tmp_path / "season.html").stat().st_size > 10_000
    assert (tmp_path / "changed.csv").exists()
