"""What is published is checked: each fault of a wheel or a source distribution is found, and versions agree."""

import base64
import hashlib
import json
import re
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from release import archive, check, crate_licences, javascript, project, scrub, trial

VERSION = project.version()
TAG = "manylinux_2_17_x86_64"
INFORMATION = f"oarlock-{VERSION}.dist-info/"


def right() -> dict[str, bytes]:
    """Members of a wheel without a fault; contents are stand-ins."""
    files = dict.fromkeys(project.package_files(), b"#")
    bill = json.dumps({"components": [{"name": "three"}]}).encode()
    about = {
        "METADATA": f"Metadata-Version: 2.4\nName: oarlock\nVersion: {VERSION}\n".encode(),
        **dict.fromkeys(check.LICENCES, b"Apache"),
        **dict.fromkeys(check.BILLS, bill),
    }
    return (
        files
        | {"oarlock/_core.abi3.so": b"\x7fELF"}
        | {INFORMATION + name: text for name, text in about.items()}
    )


def wheel(folder: Path, members: dict[str, bytes], tag: str = f"cp311-abi3-{TAG}") -> archive.Archive:
    """A wheel on disk."""
    path = folder / f"oarlock-{VERSION}-{tag}.whl"
    with zipfile.ZipFile(path, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)
    return archive.read(path)


def test_a_wheel_without_a_fault_passes(tmp_path):
    whole = wheel(tmp_path, right())
    assert check.findings(whole) == []
    assert "oarlock/data" in archive.listing(whole)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("oarlock/py.typed", None, "oarlock/py.typed: is missing"),
        ("oarlock/_core.pyi", None, "oarlock/_core.pyi: is missing"),
        ("oarlock/data/pendulum/imuData01.csv", None, "imuData01.csv: is missing"),
        ("oarlock/report/viewer/player.licences.txt", None, "player.licences.txt: is missing"),
        ("oarlock/_core.abi3.so", None, "compiled modules: [], expected one"),
        ("oarlock/notes.txt", b"", "oarlock/notes.txt: is no file of the package"),
        (INFORMATION + "licenses/NOTICE", None, "licenses/NOTICE: is missing"),
        (INFORMATION + "sboms/javascript.cdx.json", None, "sboms/javascript.cdx.json: is missing"),
        (INFORMATION + "sboms/javascript.cdx.json", b'{"components": []}', "lists no component"),
        (INFORMATION + "METADATA", b"Version: 9.9\n\n", "version 9.9, Cargo.toml says"),
    ],
)
def test_a_fault_of_a_wheel_is_found(name, content, said, tmp_path):
    members = right() | {name: content}
    found = check.findings(
        wheel(tmp_path, {key: value for key, value in members.items() if value is not None})
    )
    assert len(found) == 1 and said in found[0]


@pytest.mark.parametrize("folder", ["home/me/oarlock", "root/.cargo/registry", "tmp/build-1", "Users/me/x"])
def test_a_path_of_the_machine_is_found_in_compiled_code(folder, tmp_path):
    compiled = b"\x7fELF\0" + b"/" + folder.encode() + b"/src/lib.rs\0/rustc/59807616/library/core.rs\0"
    found = check.findings(wheel(tmp_path, right() | {"oarlock/_core.abi3.so": compiled}))
    assert len(found) == 1 and "contains the path /" + "/".join(folder.split("/")[:2]) in found[0]


def test_the_folder_of_the_build_is_taken_out_of_the_bill(tmp_path):
    name = INFORMATION + "sboms/oarlock-py.cyclonedx.json"
    text = json.dumps({"components": [{"bom-ref": f"path+{project.ROOT.as_uri()}/crates/oarlock#{VERSION}"}]})
    record = f"{name},sha256=old,1\noarlock/py.typed,sha256=kept,1\n"
    whole = wheel(tmp_path, right() | {name: text.encode(), INFORMATION + "RECORD": record.encode()})
    scrub.scrub(whole.path)
    members = archive.read(whole.path).members
    assert json.loads(members[name])["components"] == [{"bom-ref": f"path+crates/oarlock#{VERSION}"}]
    listed = dict(line.split(",", 1) for line in members[INFORMATION + "RECORD"].decode().splitlines())
    digest = base64.urlsafe_b64encode(hashlib.sha256(members[name]).digest()).rstrip(b"=").decode()
    assert listed == {name: f"sha256={digest},{len(members[name])}", "oarlock/py.typed": "sha256=kept,1"}
    assert {key for key in members if members[key] != whole.members[key]} == {name, INFORMATION + "RECORD"}


@pytest.mark.parametrize("tag", ["cp311-cp311-" + TAG, "cp312-abi3-" + TAG, "cp311-abi3-linux_x86_64"])
def test_another_tag_is_found(tag, tmp_path):
    assert [finding[:4] for finding in check.findings(wheel(tmp_path, right(), tag))] == ["tag "]


def test_a_wheel_over_its_budget_is_found(tmp_path, monkeypatch):
    whole = wheel(tmp_path, right())
    monkeypatch.setattr(project, "WHEEL_BUDGET_BYTES", whole.bytes_packed - 1)
    assert ["the budget is" in finding for finding in check.findings(whole)] == [True]


def source(folder: Path, left_out: str, further: str) -> archive.Archive:
    """A source distribution of the working copy's own names."""
    names = check.NEEDED_IN_SOURCE | {
        f"python/{name}" for name in project.package_files() if "/data/" not in name
    }
    names |= {
        path.relative_to(project.ROOT).as_posix() for path in project.EXAMPLES.rglob("*") if path.is_file()
    }
    path = folder / f"oarlock-{VERSION}.tar.gz"
    stated = folder / "PKG-INFO"
    stated.write_text(f"Version: {VERSION}\n\n")
    with tarfile.open(path, "w:gz") as file:
        for name in sorted((names | {further}) - {left_out}):
            file.add(stated, f"oarlock-{VERSION}/{name}")
    return archive.read(path)


def test_faults_of_a_source_distribution_are_found(tmp_path):
    assert check.findings(source(tmp_path, "", "README.md")) == []
    assert check.findings(source(tmp_path, "Cargo.lock", "target/x.so")) == [
        "Cargo.lock: is missing",
        "target/x.so: is built, not source",
    ]
    (alien,) = check.findings(source(tmp_path, "", "lab/pyproject.toml"))
    assert "oarlock-lab" in alien


def test_other_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"expected a wheel \(\.whl\) or a source distribution"):
        archive.read(tmp_path / "oarlock.zip")


def test_the_bill_of_the_javascript_is_up_to_date():
    assert javascript.BILL.read_text(encoding="utf-8") == javascript.text(), "run python -m release bill"


def test_the_licences_of_the_crates_are_up_to_date():
    written = crate_licences.FILE.read_text(encoding="utf-8")
    assert written == crate_licences.text(), "run python -m release bill"
    assert (
        written.count("Permission is hereby granted") > 10
        and "pyo3 " in written
        and "proptest" not in written
    )


def test_the_bill_lists_what_the_licences_in_the_bundles_name():
    listed = {part["name"]: part["version"] for part in javascript.bill()["components"]}
    for bundle, inside in javascript.BUNDLES.items():
        licences = (project.PYTHON / bundle).with_suffix(".licences.txt").read_text(encoding="utf-8")
        assert [f"{name} {listed[name]} (" in licences for name in inside] == [True] * len(inside)


def test_every_place_states_the_version_of_cargo():
    stated = f"version: {VERSION}\n"
    assert stated in (project.ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f'version: "{VERSION}"\n' in (project.ROOT / "conda/recipe.yaml").read_text(encoding="utf-8")
    lab = tomllib.loads((project.ROOT / "lab/pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert lab["version"] == VERSION and lab["dependencies"] == [f"oarlock=={VERSION}"]
    about = tomllib.loads((project.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "version" in about["dynamic"] and "version" not in about


def test_the_recipe_of_conda_has_the_requirements_of_the_package():
    about = tomllib.loads((project.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = (project.ROOT / "conda/recipe.yaml").read_text(encoding="utf-8")
    run = recipe.split("  run:\n")[1].split("\n\n")[0]
    asked = [line.strip("- ").replace(" >=", ">=") for line in run.splitlines() if line.startswith("    - ")]
    assert asked == ["python", *about["dependencies"]]
    constrained = recipe.split("  run_constraints:\n")[1].split("\n\n")[0]
    asked = [line.strip("- ").replace(" >=", ">=") for line in constrained.splitlines()]
    assert asked == about["optional-dependencies"]["full"]


def test_workflows_may_do_nothing_by_default_and_pin_their_actions():
    files = sorted((project.ROOT / ".github/workflows").glob("*.yml"))
    assert [file.stem for file in files] == ["advisories", "release", "tests"]
    for file in files:
        text = file.read_text(encoding="utf-8")
        used = [line.split("uses:")[1].split()[0] for line in text.splitlines() if "uses:" in line]
        assert "\npermissions: {}\n" in text
        assert used and all(len(action.partition("@")[2]) == 40 for action in used)


def test_make_and_workflow_run_the_same_cargo_deny():
    said = [
        re.findall(r"cargo-deny@[\d.]+", (project.ROOT / name).read_text(encoding="utf-8"))
        for name in ("Makefile", ".github/workflows/advisories.yml")
    ]
    assert len(said[0]) == 1 and said[0] == said[1]


def test_a_trial_says_which_step_failed(tmp_path):
    run = trial._Run(tmp_path, tmp_path, compilers=False)
    assert run.environment["PATH"] == str(tmp_path)
    with pytest.raises(RuntimeError, match="exit"):
        run.output(trial.sys.executable, "-c", "raise SystemExit('exit')")
