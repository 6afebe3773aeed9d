"""An option means one thing in all verbs: the table in CONVENTIONS.md has those of several verbs, with their values."""

import re
from collections import defaultdict
from pathlib import Path

from oarlock.cli import VERBS, load_verb

TEXT = (
    (Path(__file__).parents[1] / "CONVENTIONS.md")
    .read_text("utf-8")
    .partition("## Options of the command line")[2]
)
EVERYWHERE = {"--json", "--quiet", "--verbose"}
UNITS = {
    "s": "S",
    "hz": "HZ",
    "m": "M",
    "kg": "KG",
    "rad": "RAD",
    "ppm": "PPM",
    "ut": "UT",
    "ms": "MS",
    "deg": "DEG",
}


def listed() -> dict[str, set[str]]:
    """Option -> its values."""
    options = {}
    for row in re.findall(r"^\|(`--.*)\|$", TEXT, re.M):
        names, values, _ = re.split(r"(?<!\\)\|", row)
        allowed = set(re.split(r", ", values.replace("\\|", "|")))
        options |= dict.fromkeys(re.findall(r"`(--[a-z-]+)`", names), allowed)
    return options


def typed() -> dict[str, dict[str, str]]:
    """Option -> verb -> value; "" of a flag."""
    options: dict[str, dict[str, str]] = defaultdict(dict)

    def add(words: str, command: object) -> None:
        for name, inner in getattr(command, "commands", {}).items():
            add(f"{words} {name}", inner)
        for option in getattr(command, "params", ()):
            if option.param_type_name == "option" and not hasattr(command, "commands"):
                name = next(word for word in option.opts if word.startswith("--"))
                options[name][words] = "" if option.is_flag else str(option.metavar or "")

    for verb in VERBS:
        add(verb, load_verb(verb))
    return options


def test_options_of_several_verbs_are_in_the_table_with_their_values() -> None:
    table, wrong = listed(), []
    for option, verbs in typed().items():
        if len({" ".join(v.split()[:2]) for v in verbs}) > 1:
            values = {value for value in verbs.values() if value}
            if option not in table or not values <= table[option]:
                wrong.append((option, sorted(values), sorted(verbs)[:3]))
    assert not wrong
    assert len(table) > 50


def test_every_option_of_the_table_is_there() -> None:
    assert set(listed()) <= set(typed())


def test_every_verb_has_those_that_all_have() -> None:
    verbs = {verb for of in typed().values() for verb in of}
    assert all(set(typed()[option]) == verbs for option in EVERYWHERE)


def test_a_number_ends_in_its_unit() -> None:
    wrong = [
        (option, verb, value)
        for option, verbs in typed().items()
        for verb, value in verbs.items()
        if value in UNITS.values() and UNITS.get(option.rpartition("-")[2]) != value
    ]
    assert not wrong
