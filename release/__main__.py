"""`python -m release`: build, check and try wheels and the source distribution. Needs no other package to check."""

import argparse
import sys
from pathlib import Path

from release import build, check, crate_licences, javascript, trial
from release.archive import listing, read
from release.project import ROOT, version


def main() -> int:
    """Exit status: 1 if a check found something."""
    parser = argparse.ArgumentParser(prog="python -m release", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
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
    arguments = parser.parse_args()
    return _run(arguments)


def _run(arguments: argparse.Namespace) -> int:
    if arguments.verb == "wheel":
        build.build_wheel(arguments.target, arguments.out)
    elif arguments.verb == "sdist":
        build.build_source(arguments.out)
    elif arguments.verb == "bill":
        javascript.BILL.write_text(javascript.text(), encoding="utf-8")
        crate_licences.FILE.write_text(crate_licences.text(), encoding="utf-8")
    elif arguments.verb == "version":
        print(version())
    elif arguments.verb == "check":
        wrong = [file for file in arguments.files if _check(file)]
        return int(bool(wrong))
    else:
        for file in arguments.files:
            print(trial.report(file, trial.try_out(file)), flush=True)
    return 0


def _check(file: Path) -> bool:
    archive = read(file)
    wrong = check.findings(archive)
    print(listing(archive))
    print("\n".join(f"WRONG: {line}" for line in wrong) or "nothing wrong", flush=True)
    return bool(wrong)


sys.exit(main())
