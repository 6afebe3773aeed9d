"""A sculler as strapdown links: seat and oars from encoders, hands on handles, surge, mounts and skin as states."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pages import sculling

import oarlock
from exact_recording import ELEVEN, load_excerpt, read_exact, sculler
from local_data import local_folder

KNOWN = ", mount_std_rad = 1e-4, skin_std_rad = 1e-4, point_std_m = 1e-4"
"""Of a body that is as the model says."""


@cache
def links(more: str = "") -> oarlock.Model:
    text = f'format = 1\nstructure = "strapdown"\nlinks = {{ joints = "bone_in_rig"{more} }}\n'
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sculler_links.toml"
        file.write_text(sculler().text.replace("format = 1\n", text, 1))
        return oarlock.load_model(file)


def test_a_sculler_that_is_as_the_model_says() -> None:
    """The generator's body is exact: a few tenths of a degree remain of the start, and bands hold them."""
    exact = load_excerpt()
    live = oarlock.track(links(KNOWN), exact.recording, exact.nominal)
    for track in (live, oarlock.smooth(live)):
        scores = sculling.angles(track, exact.truth)
        assert scores.mean_rmse_deg(ELEVEN) < 0.5 and scores.mean_coverage(ELEVEN) > 0.95
    assert not any("never used" in note or "contradict" in note for note in live.notes)


def test_the_seat_is_where_its_encoder_says_and_the_boat_surges() -> None:
    exact = load_excerpt()
    track = oarlock.track(links(KNOWN), exact.recording, exact.nominal)
    seat = np.interp(track.time_s, exact.truth.time_s, exact.truth["seat"].position_m)
    assert np.abs(track["seat"].position_m - seat)[10:-10].max() < 0.005  # its noise is 1 mm
    smoothed = oarlock.smooth(track)
    surge = np.interp(track.time_s, exact.truth.time_s, exact.surge_m_s2)
    late = (track.time_s > 2.0) & (track.time_s < 9.5)
    apart = (smoothed.slow["surge"].value - surge)[late]
    assert np.sqrt(np.mean(apart**2)) < 0.2 and np.std(surge) > 1.5
    assert np.mean(np.abs(apart) < 1.96 * smoothed.slow["surge"].std[late]) > 0.9


def test_a_slide_without_an_encoder_is_refused_by_name() -> None:
    begin = sculler().text.index('[[sensor]]\nname = "seat"')
    text = sculler().text[:begin] + sculler().text[sculler().text.index("[[sensor]]", begin + 1) :]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "no_seat.toml"
        file.write_text(text.replace("format = 1\n", 'format = 1\nstructure = "strapdown"\n', 1))
        model = oarlock.load_model(file)
    with pytest.raises(
        oarlock.ModelError, match=r"joint 'seat' slides and no encoder reads it.*structure = \"tree\""
    ):
        oarlock.track(model, load_excerpt().recording)


@pytest.mark.long
@pytest.mark.parametrize("name", ["wild_0", "wild_7", "misfit_0"])
def test_mounts_and_skin_are_worth_more_than_a_rigid_tree(name: str) -> None:
    """Nominal lengths and mounts: live, the tree is 10 to 55 % worse (wild_7 and misfit_0)."""
    body = read_exact(local_folder("recordings") / f"{name}.npz", name)
    by_links, by_tree = (
        sculling.angles(oarlock.track(model, body.recording, body.nominal), body.truth).mean_rmse_deg(ELEVEN)
        for model in (links(), sculler())
    )
    assert by_links < 0.92 * by_tree
