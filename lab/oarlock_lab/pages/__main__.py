"""Measures the figures of some pages, keeps their records, and writes them into the pages."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from oarlock_lab.validation.__main__ import SETS

from . import coverage, emulated, faults, record, robustness, status, structures, tables, validation
from .sections import into_page
from .site import tutorials

SECTIONS: Mapping[str, Callable[[record.Record], Mapping[str, Mapping[str, str]]]] = {
    "status": status.sections,
    "structures": structures.sections,
    "coverage": coverage.sections,
    "validation": validation.sections,
    "faults": faults.sections,
    "robustness": robustness.sections,
    "emulated": emulated.sections,
    "tutorials": tutorials.sections,
}
NAMES = (*SECTIONS, "tables")


def main(arguments: list[str] | None = None) -> int:
    """Exit 0; a measurement that cannot run raises."""
    parser = argparse.ArgumentParser(prog="python -m oarlock_lab.pages", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(NAMES)}; default: all")
    parser.add_argument("--seeds", type=int, help="robustness, coverage, faults: only N seeds")
    parser.add_argument("--jobs", type=int, help="robustness, faults: processes; else all cores")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), help="validation: only these")
    parser.add_argument("--python", type=Path, help="tutorials: a Python in which a wheel is installed")
    parser.add_argument("--recorded", action="store_true", help="write the pages, measure nothing")
    options = parser.parse_args(arguments)
    if unknown := sorted(set(options.names) - set(NAMES)):
        parser.error(f"{', '.join(unknown)}: expected {', '.join(NAMES)}")
    for name in options.names or NAMES:
        if name in SECTIONS and not options.recorded:
            for measurement in _measured(name, options):
                print(f"wrote {record.save(name, measurement)}", flush=True)
        for file in write(name) if name in SECTIONS else tables.write():
            print(f"wrote {file}")
    return 0


def _measured(name: str, options: argparse.Namespace) -> Iterator[record.Record]:
    """The record, for a part of the validation after each set."""
    if name == "validation":
        yield from validation.measured(options.sets or (), record.load(name) if options.sets else None)
    elif name == "status":
        yield record.stamped(status.measured())
    elif name == "structures":
        yield record.stamped(structures.measured())
    elif name == "coverage":
        seeds = coverage.SEEDS if options.seeds is None else coverage.SEEDS[: options.seeds]
        yield record.stamped(coverage.measured(seeds))
    elif name == "faults":
        yield record.stamped(faults.measured(faults.SEEDS[: options.seeds], options.jobs))
    elif name == "tutorials":
        yield record.stamped(tutorials.measured(options.python or Path(sys.executable)))
    elif name == "emulated":
        yield record.stamped(emulated.measured())
    else:
        count: int | None = options.seeds
        yield record.stamped(robustness.measured(None if count is None else range(count), options.jobs))


def write(name: str, root: Path = record.ROOT) -> list[Path]:
    """Put the record of this name into its pages."""
    files = []
    for page, texts in SECTIONS[name](record.load(name, root)).items():
        file = root / page
        text = file.read_text(encoding="utf-8")
        for mark, section in texts.items():
            text = into_page(text, section, mark)
        file.write_text(text, encoding="utf-8")
        files.append(file)
    return files


if __name__ == "__main__":
    sys.exit(main())
