"""Commands of the pages: all name verbs and options that exist, and run page by page as a reader runs them."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from oarlock.cli import VERBS, load_verb
from oarlock_lab.pages.site.presumed import NOT_RUN, PRESUMED, QUICKER, presume
from oarlock_lab.pages.site.steps import Reader, steps, with_reasons

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(?:sh|console)\n(.*?)^```$", re.M | re.S)


def commands(page):
    text = "\n".join(BLOCK.findall(page.read_text(encoding="utf-8"))).replace("\\\n", " ")
    return [
        line.strip().removeprefix("$ ") for line in text.splitlines() if re.match(r"\s*(\$ )?oarlock\b", line)
    ]


WITH_STEPS = [page for page in PAGES if any(steps(page.read_text(encoding="utf-8")))]
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
    found = {one: misspelt(one) for name, one in COMMANDS if name == page}
    assert {one: word for one, word in found.items() if word} == {}


def test_a_misspelt_option_is_found():
    assert misspelt("oarlock track trial --modell sculler") == "--modell"


def test_no_page_hides_commands_in_an_indented_block():
    found = [page.name for page in PAGES if re.search(r"\n\n    oarlock ", page.read_text(encoding="utf-8"))]
    assert found == []


def test_what_is_not_run_or_presumed_is_still_in_a_page():
    shown = {page.stem: list(steps(page.read_text(encoding="utf-8"))) for page in PAGES}
    every = [step.text for found in shown.values() for step in found]
    assert [start for start in NOT_RUN if not any(text.startswith(start) for text in every)] == []
    assert [start for start in QUICKER if not any(text.startswith(start) for text in every)] == []
    words = {name: " ".join(step.text for step in found) for name, found in shown.items()}
    presumed = [(page, one.split("=")[0]) for page, names in PRESUMED.items() for one in names]
    assert [(page, name) for page, name in presumed if name not in words[page]] == []


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    return tmp_path_factory.mktemp("presumed")


@pytest.mark.long
@pytest.mark.parametrize("page", WITH_STEPS, ids=lambda page: page.stem)
def test_a_page_runs_as_written(page, pool, tmp_path, capsys):
    programs = Path(sys.executable).parent
    presume(page.stem, tmp_path, pool, lambda folder, command: Reader(folder, programs).finish(command))
    text = page.read_text(encoding="utf-8")
    lines = [f"{took_s:7.1f} s  {shown}" for shown, took_s in Reader(tmp_path, programs).follow(text)]
    lines += [f"NOT RUN  {step.title}: {why}" for step, why in with_reasons(text) if why]
    with capsys.disabled():
        print("", *(f"{page.stem}: {line}" for line in lines), sep="\n")


def test_what_an_absent_recording_would_have_made_is_missing_later(monkeypatch):
    page = "```sh\noarlock run ngimu_data.csv --out reach\noarlock export reach/track\noarlock demo\n```\n"
    monkeypatch.setenv("OARLOCK_DATA", "/nowhere")
    reasons = [why for _, why in with_reasons(page)]
    assert "ngimu_data.csv is absent" in reasons[0] and "reach/ is absent" in reasons[1] and not reasons[2]
