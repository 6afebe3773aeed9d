"""The site: links that lead somewhere, equations, a page for each public name, keys of model files, no requests."""

import pytest

pytest.importorskip("griffe", reason="the site needs griffe, latex2mathml and zensical (make site)")
pytest.importorskip("latex2mathml")

import oarlock
from headless_chromium import chromium, quiet_tabs, serious_violations
from oarlock.cli import VERBS
from oarlock_lab.pages.site import __main__ as site
from oarlock_lab.pages.site import api, commands, finish, gallery, model_keys, stage


def test_each_public_name_has_a_page_with_text(tmp_path):
    api.write_pages(tmp_path)
    for package, names in api.public_names().items():
        for name in names:
            text = (tmp_path / f"reference/api/{package}/{name}.md").read_text(encoding="utf-8")
            assert len(text.splitlines()) > 3, name
    assert {"Track", "load_model"} <= set(api.public_names()["oarlock"])
    track = (tmp_path / "reference/api/oarlock/Track.md").read_text(encoding="utf-8")
    assert "| `q_std` |" in track and "## frame_positions" in track


def test_each_verb_has_a_page_with_its_help(tmp_path):
    commands.write_pages(tmp_path)
    pages = {page.stem for page in (tmp_path / "reference/commands").iterdir()}
    assert pages == {*VERBS, "index"}
    assert "--calibration" in (tmp_path / "reference/commands/track.md").read_text(encoding="utf-8")
    assert "## oarlock season erase" in (tmp_path / "reference/commands/season.md").read_text(
        encoding="utf-8"
    )


def test_the_page_of_model_files_has_the_keys_that_the_engine_knows():
    model_keys.check_keys()


def test_a_key_that_the_page_lacks_is_found(monkeypatch):
    keys = model_keys.keys_of
    monkeypatch.setattr(model_keys, "keys_of", lambda title: keys(title) - {"limits"})
    with pytest.raises(ValueError, match="limits"):
        model_keys.check_keys()


def test_pages_of_the_repository_become_pages_of_the_site(tmp_path):
    stage.stage(tmp_path)
    index = (tmp_path / "index.md").read_text(encoding="utf-8")
    assert "(conventions.md)" in index
    filter_page = (tmp_path / "filter.md").read_text(encoding="utf-8")
    assert "$" not in filter_page and filter_page.count("<math") > 20


def test_a_request_to_another_server_is_an_error(tmp_path):
    (tmp_path / "a.html").write_text(f'<script src="{finish.SHIM_URL}"></script>', encoding="utf-8")
    finish.finish(tmp_path)
    assert 'src="iframe-worker.js"' in (tmp_path / "a.html").read_text(encoding="utf-8")
    (tmp_path / "b.html").write_text(
        '<a href="https://x.org">x</a><img src="https://x.org/a.png">', encoding="utf-8"
    )
    with pytest.raises(ValueError, match=r"b\.html: <img"):
        finish.finish(tmp_path)


def test_the_gallery_names_the_commands_of_each_page(tmp_path):
    gallery.write_pages(tmp_path / "docs", tmp_path / "work", made=False)
    text = (tmp_path / "docs/gallery.md").read_text(encoding="utf-8")
    assert text.count("[Open]") == len(gallery.PIECES)
    assert "oarlock report ramped --compare tracked" in text


@pytest.fixture(scope="module")
def built():
    pytest.importorskip("zensical")
    assert site.main([]) == 0
    return site.OUT / "html"


@pytest.mark.long
def test_the_site_builds_strictly(built):
    assert finish.requests(built) == []
    assert all((built / "gallery" / one.file).stat().st_size > 10_000 for one in gallery.PIECES)
    assert oarlock.__version__ in (built / "changelog.html").read_text(encoding="utf-8")


@pytest.mark.long
@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_axe_finds_no_serious_violation_in_pages_of_the_site(built, width, scheme):
    # axe itself asks for the style sheets, which a page from a disk may not read.
    blocked = ("CORS policy", "net::ERR_FAILED", "load preload assets")
    with chromium("THE SITE WAS NOT TRIED IN A BROWSER") as browser, quiet_tabs(browser, blocked) as opened:
        for page in ("index.html", "stroke-exports.html", "filter.html"):
            assert serious_violations(opened(built / page, width, color_scheme=scheme)) == [], page
