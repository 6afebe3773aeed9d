"""Prepares the pages of the site in out/site/docs and builds it strictly into out/site/html."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from . import api, commands, gallery, model_keys, moving_figure, stage
from .finish import finish
from .stage import ROOT

OUT = ROOT / "out/site"


def main(arguments: list[str] | None = None) -> int:
    """Exit 0, or the exit status of the builder."""
    parser = argparse.ArgumentParser(prog="python -m oarlock_lab.pages.site", description=__doc__)
    parser.add_argument("--builder", choices=("zensical", "mkdocs"), default="zensical")
    parser.add_argument(
        "--without-gallery", action="store_true", help="links instead of reports, to look at prose"
    )
    options = parser.parse_args(arguments)
    docs = OUT / "docs"
    shutil.rmtree(docs, ignore_errors=True)
    shutil.rmtree(OUT / "html", ignore_errors=True)
    stage.stage(docs)
    api.write_pages(docs)
    commands.write_pages(docs)
    model_keys.write_pages(docs)
    moving_figure.write_picture(docs / "moving-sculler.svg")
    gallery.write_pages(docs, OUT / "work", made=not options.without_gallery)
    status = build(options.builder)
    if status == 0:
        finish(OUT / "html")
    return status


def build(builder: str) -> int:
    """Turn the prepared pages into HTML; a warning is an error."""
    program = Path(sys.executable).with_name(builder)
    done = subprocess.run(
        [program, "build", "--strict", "--clean"], cwd=ROOT, env={**os.environ, "NO_COLOR": "1"}, check=False
    )
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
