"""`python -m release`: build, check and try wheels and the source distribution. Needs no other package to check."""

import argparse
import sys
from pathlib import Path

from release import build, check, crate_licences, javascript, trial
from release.archive import listing, read
from release.project import ROOT, version


def main() -> int:
    """Exit status: 1 if a check found something."""
    asked = argparse.ArgumentParser(prog="python -m release", description=__doc__)
    verbs = asked.add_subparsers(dest="verb", required=True)
    for name, text in (("wheel", "build a wheel"), ("sdist", "build the source distribution")):
        verb = verbs.add_parser(name, help=text)
        verb.add_argument("--out", type=Path, default=ROOT / "dist", help="folder to write")
        if name == "wheel":
            verb.add_argument("--target", help="target triple of Rust; this machine's own if it is not given")
    verbs.add_parser("version", help="print the version that Cargo.toml states")
    verbs.add_parser("bill", help="write THIRDPARTY.txt and the bill of materials of the JavaScript")
    for name, text in (
        ("check", "list and check contents"),
        ("try", "install into an empty environment and run"),
    ):
        verbs.add_parser(name, help=text).add_argument("files", nargs="+", type=Path)
    given = asked.parse_args()
    return _run(given)


def _run(given: argparse.Namespace) -> int:
    if given.verb == "wheel":
        build.build_wheel(given.target, given.out)
    elif given.verb == "sdist":
        build.build_source(given.out)
    elif given.verb == "bill":
        javascript.BILL.write_text(javascript.text(), encoding="utf-8")
        crate_licences.FILE.write_text(crate_licences.text(), encoding="utf-8")
    elif given.verb == "version":
        print(version())
    elif given.verb == "check":
        wrong = [file for file in given.files if _check(file)]
        return int(bool(wrong))
    else:
        for file in given.files:
            print(trial.report(file, trial.try_out(file)), flush=True)
    return 0


def _check(file: Path) -> bool:
    archive = read(file)
    found = check.findings(archive)
    print(listing(archive))
    print("\n".join(f"WRONG: {line}" for line in found) or "nothing wrong", flush=True)
    return bool(found)


sys.exit(main())
