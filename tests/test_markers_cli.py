"""`oarlock markers` and `oarlock evaluate` with markers, typed as a laboratory would."""

import json
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from test_docs import blocks

EXAMPLE = Path(__file__).parents[1] / "examples/markers"
TRUE_LENGTHS_M = {"l_ua": 0.298, "l_fa": 0.245}
LENGTH_M = 1e-3  # 1 mm of noise in some 200 frames of a dozen markers


def test_show_tells_what_is_in_a_file():
    text = run("markers", "show", EXAMPLE / "reach.trc").output
    assert "3 filled, 1 left" in text
    assert "longer than 0.2 s" in text
    document = json.loads(run("markers", "show", EXAMPLE / "reach.trc", "--json").stdout)
    assert len(document["markers"]) == 12
    assert [gap["marker"] for gap in document["gaps"] if not gap["filled"]] == ["FA3"]


def console_of_the_page() -> list[list[str]]:
    block = blocks(EXAMPLE.parents[1] / "docs/markers.md", "console")[0]
    return [line.split()[1:] for line in block.splitlines() if line.startswith("oarlock ")]


def test_a_session_becomes_a_study_that_is_tracked_and_scored(tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(EXAMPLE.parent)
    monkeypatch.chdir(tmp_path)
    show, simulate, track, truth, markers = console_of_the_page()
    assert "longer than 0.2 s" in run(*show).output
    document = json.loads(run(*simulate, "--json").stdout)
    for name, length in TRUE_LENGTHS_M.items():
        assert abs(document["body"]["lengths"][name]["length_m"] - length) < LENGTH_M
    assert sum(not gap["filled"] for gap in document["gaps"]) == 1
    assert max(error["rmse_mm"] for error in document["marker_errors"].values()) < 2.0
    assert Path("study/gaps.csv").read_text(encoding="utf-8").count("\n") == 1 + len(document["gaps"])
    assert oarlock.load_recording("study").names == ("upperarm", "forearm", "hand")
    page = Path("study/report.html").read_text(encoding="utf-8")
    assert all(name in page for name in ("FA3", "longer than 0.2 s", "shoulder_<wbr>abduction"))
    run(*track)
    assert json.loads(run(*truth, "--json").stdout)["mean_rmse_deg"] < 0.2
    points = json.loads(run(*markers, "--json").stdout)
    assert abs(points["clock_offset_s"]) < 0.01
    assert points["mean_rmse_3d_m"] < 4e-3, "1.7 mm of it are the noise of the markers"
    text = run(
        "evaluate", "out", "study/markers.trc", "--frames", "HA1=hand,FA2=wrist", "--clock", "same"
    ).output
    assert "axes of root" in text
    assert "HA1" in text


def test_attach_places_markers_by_a_static_trial(tmp_path):
    model = oarlock.load_model("arm7")
    rest = model.forward_kinematics(np.zeros(7))[model.frame_names.index("wrist")]
    place = rest[:3, :3] @ [0.0, 0.05, 0.02] + rest[:3, 3]
    oarlock.markers.Markers(("WRA",), [0.0, 0.1], np.tile(place, (2, 1, 1))).save(tmp_path / "static.csv")
    command = (
        "markers",
        "attach",
        tmp_path / "static.csv",
        "--model",
        "arm7",
        "--frames",
        "WRA=wrist",
        "--out",
    )
    run(*command, tmp_path / "p.toml")
    np.testing.assert_allclose(
        oarlock.markers.load_attachments(tmp_path / "p.toml")[0].point_m, [0.0, 0.05, 0.02], atol=1e-12
    )
    assert "exists" in run(*command, tmp_path / "p.toml", status=2).output


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("markers", "show", "none.trc"), 1, "no such file"),
        (("markers", "show", EXAMPLE / "reach.trc", "--axes", "z"), 1, "y-up-from-z-up"),
        (
            ("markers", "attach", EXAMPLE / "reach.trc", "--frames", "T1", "--out", "x.toml"),
            2,
            "MARKER=FRAME",
        ),
    ],
)
def test_mistakes_are_told(arguments, status, said):
    assert said in run(*arguments, status=status).output


def test_the_example_is_what_its_maker_makes(tmp_path):
    import runpy
    import shutil

    for name in ("make_trial.py", "person.toml", "arm.toml"):
        shutil.copy(EXAMPLE / name, tmp_path / name)
    runpy.run_path(str(tmp_path / "make_trial.py"), run_name="__main__")
    made, shipped = (oarlock.markers.load_markers(folder / "reach.trc") for folder in (tmp_path, EXAMPLE))
    np.testing.assert_allclose(
        made.position_m, shipped.position_m, atol=1.1e-4
    )  # printed to a tenth of a millimetre
