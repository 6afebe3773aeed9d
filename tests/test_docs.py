"""The documentation is right: examples run, commands work, model files load. Links are a check of `make lint`."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from oarlock.cli import VERBS, load_verb

ROOT = Path(__file__).parents[1]
MODEL_PAGE = ROOT / "docs/model-files.md"


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S)


def run(arguments: list[str], folder: Path) -> str:
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(arguments[:6])}\n{done.stdout}\n{done.stderr}"
    return done.stdout


WITHOUT_FILES = [
    code
    for code in blocks(ROOT / "docs/python.md", "python")
    if "load_track(" not in code and "load_recording(" not in code
]


@pytest.mark.parametrize(
    "code",
    [*blocks(ROOT / "README.md", "python"), *WITHOUT_FILES],
    ids=lambda code: code.splitlines()[-1][:40],
)
def test_example_of_readme_and_python_page_runs(code, tmp_path):
    assert run([sys.executable, "-c", code], tmp_path).strip()


def test_the_tutorial_shows_a_whole_model(tmp_path):
    import oarlock

    page = ROOT / "docs/tutorials/own-body.md"
    file = tmp_path / "two_links.toml"
    file.write_text(blocks(page, 'toml title="two_links.toml"')[0], encoding="utf-8")
    model = oarlock.load_model(file)
    assert tuple(model.joint_names) == ("first", "second")


def free_body() -> str:
    return next(block for block in blocks(MODEL_PAGE, "toml") if 'name = "trunk_and_arm"' in block)


def test_recipe_of_a_ball_on_a_free_body(tmp_path):
    import oarlock

    file = tmp_path / "free.toml"
    file.write_text(free_body(), encoding="utf-8")
    model = oarlock.load_model(file)
    turns, places = ("rx", "ry", "rz"), ("x", "y", "z")
    trunk = [f"trunk.{label}" for label in places + turns]
    assert model.coordinate_names == [*trunk, *(f"r_shoulder.{label}" for label in turns)]
    assert [joint.angles for joint in model.describe().joints] == ["ZXY", "YXY"]


def test_recipe_of_a_ball_with_pushes_in_place_of_a_free_body(tmp_path):
    import oarlock

    push = next(block for block in blocks(MODEL_PAGE, "toml") if block.startswith("[[base_acceleration]]"))
    pushes = "\n".join(push.replace("push_x", f"push_{axis}").replace('"x"', f'"{axis}"') for axis in "xyz")
    ball = re.sub(
        r"^translation = .*\n", "", free_body().replace('kind = "free"', 'kind = "ball"'), flags=re.M
    )
    states = {}
    for name, text in (("free", free_body()), ("ball", ball + "\n" + pushes)):
        file = tmp_path / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        states[name] = oarlock.load_model(file).state_names
    assert {"push_x", "push_y", "push_z"} <= set(states["ball"])
    assert len(states["free"]) - len(states["ball"]) == 3, "the page says three states less"


def test_recipe_adds_a_joint(tmp_path):
    import oarlock
    from oarlock.model.shipped_files import model_path

    recipe = next(block for block in blocks(MODEL_PAGE, "toml") if "head_rotation" in block)
    file = tmp_path / "my.toml"
    file.write_text(model_path("sculler").read_text(encoding="utf-8") + "\n" + recipe, encoding="utf-8")
    model = oarlock.load_model(file)
    assert model.joint_names[-1] == "head_rotation"
    assert "head.mag_z" in model.measurement_names


def test_recipe_sets_a_length_that_exists():
    from oarlock.model.shipped_files import model_path

    recipe = next(block for block in blocks(MODEL_PAGE, "toml") if block.startswith("l_ua_r"))
    (name,) = tomllib.loads(recipe)
    sculler = tomllib.loads(model_path("sculler").read_text(encoding="utf-8"))
    assert set(sculler["parameters"][name]) == set(tomllib.loads(recipe)[name])


def test_lists_of_verbs_name_verbs_that_exist():
    page = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    readme = (ROOT / "README.md").read_text(encoding="utf-8").split("| you want to |")[1].split("\n\n")[0]
    lines = re.findall(r"^- .*$", page, re.M)
    verbs = {verb for line in lines for verb in re.findall("`(.*?)`", line)}
    verbs |= set(re.findall("`(.*?)`", readme))
    assert len(verbs) > 20 and not {verb for verb in verbs if not is_verb(verb.split())}


def is_verb(words):
    command = load_verb(words[0]) if words[0] in VERBS else None
    for word in words[1:]:
        command = command and getattr(command, "commands", {}).get(word)
    return command is not None
